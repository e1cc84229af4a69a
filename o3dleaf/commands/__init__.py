"""The command line: a command reads files, does one job of the package, and writes files.

`line`         words of a command line, and what is shown while it runs
`sample`       `o3dleaf sample`
`patch`        `o3dleaf patch`
`leaf`         `o3dleaf leaf`, and the mesh that it writes
`demo`         `o3dleaf demo`
`figures`      `o3dleaf figures`
`reconstruct`  `o3dleaf reconstruct`
`clean`        `o3dleaf clean`
`droplet`      `o3dleaf droplet`, and the options of its case in `o3dleaf export`
`export`       `o3dleaf export`
`qa`           `o3dleaf qa`
`info`         `o3dleaf info`
`render`       `o3dleaf render`
`windows`      `o3dleaf view` and `o3dleaf pick`
`warm_up`      `o3dleaf warm-up`
`batch`        `o3dleaf batch`
`cli`          all of them, made of the fields of their jobs
"""
