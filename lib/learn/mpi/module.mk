# SPDX-License-Identifier: GPL-2.0-or-later
# Training on many computers.
modules := ranks_mpi
pc_ranks_mpi := ompi-c
