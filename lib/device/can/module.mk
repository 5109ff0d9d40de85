# SPDX-License-Identifier: GPL-2.0-or-later
# A drive on one of two kinds of bus: each module has the files of its own transport only.
modules := stepper_can stepper_slcan
pc_stepper_can := libmnl
only_stepper_can := stepper_can bus/socketcan%
only_stepper_slcan := stepper_slcan bus/slcan%
