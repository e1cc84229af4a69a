"""Limits of memory and time; what needs more is refused before the work.

`sizes`      sizes in words and from words: 2 GB
`durations`  the same of durations: 10 min
`machine`    memory of the process, and the limits of system, container and shell
`budget`     the rest of the least of them and of what was stated
`measured`   measured costs of work
`needs`      predicted needs of work; more than there is is refused
`scratch`    numbers in a temporary file where memory would not hold them
"""
