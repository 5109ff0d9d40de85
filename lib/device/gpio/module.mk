# SPDX-License-Identifier: GPL-2.0-or-later
# Steps on lines of a GPIO chip, by either version of libgpiod, which have nothing in common.
modules := stepper_gpio
pc_stepper_gpio := libgpiod
not_stepper_gpio := gpio_v$(if $(shell $(PKG_CONFIG) --atleast-version=2 libgpiod && echo yes),1,2)
