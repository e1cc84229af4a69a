"""Models that were saved: interpolants, tiled fields, blades and leaves.

`model_arrays`  what their arrays must be, before compiled loops index by them
`models`        read again
"""
