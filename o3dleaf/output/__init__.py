"""What leaves the package: files for the next program, pictures, reports, figures.

`export`   meshes, particles and distances for other programs
`view`     pictures and the interactive window
`report`   what is known of a mesh, a file or a run
`figures`  figures like the paper's
"""
