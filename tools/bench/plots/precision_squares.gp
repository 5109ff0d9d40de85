# SPDX-License-Identifier: GPL-2.0-or-later
# Least squares of training: the error of the unknowns over the condition of the equations.
set title sprintf("Least squares of training: error of the unknowns over the condition of the equations\n%s, %s", cpu, kernel)
set xlabel 'condition of the equations / 1'
set ylabel 'error of the unknowns, relative / 1'
set logscale xy
set format xy power
eval key_below
plot for [i=1:words(data_name)] data index word(data_name, i) using "condition":"unknowns_error" \
	with linespoints lt i title word(data_name, i)
