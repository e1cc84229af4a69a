"""One local interpolant: polyharmonic kernel, polynomial tail, smoothing, solve.

The chapter answers one question: given a few hundred scattered values, which function of least
bending energy takes them (or nearly takes them, when smoothed)? Everything above it only knows that
the answer can be evaluated and differentiated.
"""
