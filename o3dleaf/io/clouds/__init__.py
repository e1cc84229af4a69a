"""Point clouds in formats that Open3D does not read, each as columns of float64.

`columns`  what a file says of its points: coordinates, normals, colors
`header`   names, separator and comments of a text file
`text`     TXT, CSV and ASC
`las`      LAS and LAZ, by laspy
`e57`      E57, by pye57
"""
