"""The command line: a command reads files, does one job of the package, and writes files.

`terminal`     bars and lines while a command runs
`leaf`         `o3dleaf leaf`
`reconstruct`  `o3dleaf reconstruct`
`export`       `o3dleaf export`
`figures`      `o3dleaf figures`
`cli`          all commands with their options
"""
