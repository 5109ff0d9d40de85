# SPDX-License-Identifier: GPL-2.0-or-later
# Largest error over the time of an evaluation, a colour and marker for each kind of evaluator.
# What could not be measured is said: another project's evaluator that is not there.
absent = ''
kinds = ''
failed(row) = strlen(strcol("failed")) > 0
note(kind) = strstrt(kinds, "'".kind."'") ? 0 : (kinds = kinds."'".kind."' ", 0)
stats data using (!failed(0) ? note(strcol("kind")) : \
	column("peer") == 1 ? (absent = sprintf("; no %s: %s", strcol("name"), strcol("failed")), 0) : 0) nooutput
set title sprintf("Largest error of an evaluator over its run time, model of %d rules%s\n\
bars: 5 to 95 %% of the runs; upward: to the certified bound\n%s, %s", rules, absent, cpu, kernel)
set xlabel 'median time per evaluation / ns'
set ylabel 'largest error / N'
set logscale xy
set format y power
# An error of 0 has no place on a logarithmic axis.
error(key) = column(key) > 1e-17 ? column(key) : 1e-17
stats data using "ns_p5" prefix "fast" nooutput
stats data using "ns_p95" prefix "slow" nooutput
stats data using (error("max_error_N")) prefix "good" nooutput
stats data using (error("max_error_N")) prefix "bad" nooutput
stats data using "bound_N" prefix "bound" nooutput
x0 = fast_min / 1.3
x1 = slow_max * 1.3
y0 = good_min / 10
y1 = (bound_max > bad_max ? bound_max : bad_max) * 10
name_bottom = below(2)
eval name_margins
x(key) = log_place(column(key), x0, x1)
y(key) = log_place(error(key), y0, y1)
stats data using (failed(0) ? NaN : name_point(words_of(strcol("name")), x("ns"), \
	y("max_error_N"), x("ns_p5"), x("ns_p95"), y("max_error_N"), \
	column("bound_N") > 0 ? y("bound_N") : y("max_error_N"))) nooutput
eval name_points
set xrange [x0:x1]
set yrange [y0:y1]
eval key_at
of(kind, y) = strcol("kind") eq kind ? y : NaN
plot for [i=1:words(kinds)] data using "ns":(of(word(kinds, i), error("max_error_N"))):(0): \
		(column("bound_N") - error("max_error_N")) with vectors nohead lt i lw 0.6, \
	for [i=1:words(kinds)] data using "ns":(of(word(kinds, i), error("max_error_N"))):"ns_p5":"ns_p95" \
		with xerrorbars lt i lw 1 title word(kinds, i)
