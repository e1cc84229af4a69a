"""Stretches of the margin that are hidden, and the other half's mirror image.

`halves`  the two halves of a blade, and where one lacks a stretch that the other has
`images`  the mirror image of what the other half has there
"""
