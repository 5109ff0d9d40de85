# SPDX-License-Identifier: GPL-2.0-or-later
# Force samples from two kinds of converters.
modules := force_iio force_comedi
pc_force_iio := libiio < 1
only_force_iio := iio_%
pc_force_comedi := comedilib
only_force_comedi := comedi_%
