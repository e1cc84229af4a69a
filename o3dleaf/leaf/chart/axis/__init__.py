"""The axis of a blade in the plane: where it ends, and sections across it.

`sections`  straight sections across an outline
`ends`      the first axis between the ends of a blade
"""
