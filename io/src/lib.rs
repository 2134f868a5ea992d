//! HDF5, XDMF, series, atomic files and manifests.
