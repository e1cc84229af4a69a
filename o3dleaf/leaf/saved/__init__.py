"""Models that were saved: interpolants, tiled fields, blades and leaves.

`array_kinds`   requirements on one array
`relations`     relations between the arrays of an object
`model_arrays`  what all of them must be, before compiled loops index by them
`models`        read again
`contents`      told in plain values
"""
