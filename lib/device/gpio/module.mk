# SPDX-License-Identifier: GPL-2.0-or-later
# Steps on lines of a GPIO chip.
modules := stepper_gpio
