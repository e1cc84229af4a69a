"""Field to triangles: sample a lattice, polygonise, clip, keep the sheets, clean, report, write.

The road through the chapter, one module a step:

`lattice`     where the field is asked: a regular lattice over a box, sampled in bounded memory
`polygonise`  samples to triangles: marching cubes or marching tetrahedra, plane by plane
`isosurface`  the two together, for any Field
`band`        any Field again, but only where its surface is: cells followed from seeds (`wavefront`), creases drawn
              as edges (`creases`)
`trim`        what no data support is cut off; `support` what they say for each vertex
`clip`        triangles outside an outline are discarded, the rim is left manifold
`components`  edge-connected pieces; the largest are kept, voids and specks are counted
`quality`     `mesh_report`: what a mesh is, in numbers; `defects` the triangles of every defect; `inspection` both
`mend`        `clean_mesh`: repairs in rounds until a mesh is at rest
`clean`       simplification and Poisson by MeshLab's filters (the only file that imports pymeshlab)
`files`       meshes to disk, whole or not at all

`arrays` holds the door between Open3D's meshes and NumPy, `topology` the edges, fans and loops that
the others count with (`adjacency` its compiled code), `anatomy` all that is found out about a mesh in
one pass, `crossings` the triangles that meet (`forest` which could, `contact` which do, `predicates` the
exact signs that decide), `measures` angles and sizes, `deviation` distances to a field and a scan, `draft`
a mesh under repair, `apart` a call in a process of its own, `loops` the compiled code of polygonisation, and
`band_loops`, `crease_loops` and `support_loops` that of bands, creases and support.
Nothing here knows where a field comes from.
"""
