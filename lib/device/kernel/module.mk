# SPDX-License-Identifier: GPL-2.0-or-later
# A stepper on the kernel module incise_stepper.
modules := stepper_kernel
