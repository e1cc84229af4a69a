"""How much memory may be used, and what needs more refused before the work.

`sizes`     sizes in words and from words: 2 GB
`machine`   what the process holds, and the limits of system, container and shell
`measured`  what work was measured to hold
`budget`    what is left of the least of them and of what was stated, and what needs more refused
"""
