"""What all commands have in common: the words that ask for them, and what is shown while they run.

`words`     words of a command line into a job
`terminal`  bars and lines while a command runs
"""
