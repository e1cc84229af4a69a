"""Reports of a mesh, a file or a run, for people (a page) and for programs (JSON).

`summary`       the summary of a run: settings, units, sizes, times, versions
`words`         figures with their names, kinds and units
`requirements`  what a mesh must be, "watertight,components=1,min-angle=10", and whether it is
`examine`       a mesh examined: figures, verdict, JSON and page
`compose`       the parts of the page
`page`          the page, with `assets/page.css`
`reduce`        fewer triangles, to look at
`places`        places of defects, and views of them
`shots`         pictures of a mesh, shaded
`closeups`      the worst triangles and every defect
`overviews`     the mesh from several sides
`charts`        histograms
`viewer`        the data of the interactive view, which `assets/viewer.js` draws
"""
