"""Machine code: compiled once for a level of processors, shipped with the package, kept on disk.

`decorator`     the decorator of every compiled function
`sources`       the source text that a compiled function depends on
`code_files`    compiled code in files, each with the key that it was made for
`level_code`    Numba's code generator for a level of processors
`code_cache`    compiled code on disk, in Numba's terms
`borrowed`      no reference counts in functions that make no array
`numba_target`  Numba's compiler with these three; these four alone know its inner parts
`signatures`    the functions that the main jobs and the tests call, with the types that they call them with
`warm_up`       all of these compiled before the first job, on all cores
"""
