# SPDX-License-Identifier: GPL-2.0-or-later
# Exports as HDF5.
modules := export_hdf5
pc_export_hdf5 := hdf5 zlib
