"""Volumes from files: one module a family of formats, each to an array and what the file states of it.

`stated`    lattice, order of axes and type of voxels, as a file states them
`tiff_pages`  the chain of a TIFF's pages, whole or not
`tiff`      TIFF stacks in and out
`slices`    folders of TIFF and PNG slices
`bare`      NPY, NPZ, and bare numbers of a given layout
`lattice_headers`  headers of MetaImage, NRRD and NIfTI, looked over
`dicom_headers`  headers of DICOM, looked over
`itk`       NRRD, MetaImage, NIfTI and DICOM, by SimpleITK
`scanco`    ISQ and AIM
`hdf5`      HDF5, by h5py
`ome_zarr`  OME-Zarr, by zarr
`points`    PLY of points with an intensity
`content`   the kind of a file by its first bytes
`counts`    about how many voxels a file has
`read`      `read_volume` and `open_volume`, by the suffix of the name
"""
