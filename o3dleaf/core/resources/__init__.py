"""Limits of memory and time; what needs more is refused before the work.

`sizes`      sizes in words and from words: 2 GB
`durations`  the same of durations: 10 min
`machine`    what the process holds, and the limits of system, container and shell
`budget`     what is left of the least of them and of what was stated
`measured`   what work was measured to cost
`needs`      what work will need, and what needs more than there is refused
`scratch`    numbers in a temporary file where memory would not hold them
"""
