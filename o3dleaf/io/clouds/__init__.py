"""Point clouds in formats that Open3D does not read, each as columns of float64; whether those that it reads are whole.

`columns`  what a file says of its points: coordinates, normals, colors
`header`   names, separator and comments of a text file
`text`     TXT, CSV and ASC
`las`      LAS and LAZ, by laspy
`e57`      E57, by pye57
`cut_off`  PTS, PCD and columns of numbers that end too early
`counts`   about how many points or triangles a file has
"""
