"""The base of every chapter: errors, checks, units, the field protocol, threads, the doors to Open3D and the disk.

`errors`         the errors and warnings that reach a user
`checks`         validation of input, all of it
`units`          units of length
`arguments`      arguments of public functions, held to their annotations
`field`          the protocol between what fits a function and what makes triangles of it
`newton`         Newton's method onto a level set
`compiled`       machine code for a level of processors, shipped with the package and kept on disk
`outside_loops`  a field outside its bounds
`lattice`        a regular lattice over a box, sampled in bounded memory
`resume`         finished parts of long work, kept beside its result
`progress`       progress of the running work, by context
`parallel`       the thread pool that drives compiled loops over fixed blocks
`even_sample`    rows evenly spread over all
`trees`          queries of k-d trees, on as many threads as they are worth
`resources`      the memory and the time that may be used, and what needs more refused
`journal`        the stages of a long job, timed
`jobs`           a job on files, whose fields are the options of its command
`cloud_arrays`   Open3D point clouds and arrays
`mesh_arrays`    Open3D triangle meshes and arrays
`places`         places of the world as messages tell them
`atomic_files`   files written whole or not at all
`processes`      calls in other processes, of this machine and of others
"""
