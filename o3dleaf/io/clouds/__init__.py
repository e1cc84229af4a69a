"""Point clouds by format, each as columns of float64.

`columns`  columns of a file of points: coordinates, normals, colors
`header`   names, separator and comments of a text file
`text`     TXT, CSV and ASC
`las`      LAS and LAZ, by laspy
`las_header`  their headers, against the size of the file
`e57`      E57, by pye57
`pcd`      PCD
`lzf`      compressed PCD unpacked
`pts`      PTS
`npy`      NPY
`bgeo`     BGEO, written for programs that read by Partio
`cut_off`  PTS and columns of numbers that end too early
`counts`   about how many points or triangles a file has
"""
