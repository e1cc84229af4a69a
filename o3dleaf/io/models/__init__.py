"""Saved models: one file, no pickle.

`model_file`   models written, and read without executing anything
`model_draft`  a model file that is being made, its coefficients in it before the rest is known
"""
