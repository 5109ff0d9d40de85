# SPDX-License-Identifier: GPL-2.0-or-later
# Streams of the Lab Streaming Layer; liblsl is opened at run time, and needs no package here.
modules := force_lsl outlet_lsl
only_force_lsl := lsl_force
only_outlet_lsl := lsl_outlet
