# SPDX-License-Identifier: GPL-2.0-or-later
# Driver chips of TRINAMIC between the step line and the motor, each on its own kind of line.
modules := driver_tmc2209 driver_tmc5160
only_driver_tmc2209 := tmc2209
only_driver_tmc5160 := tmc5160
