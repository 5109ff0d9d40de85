# SPDX-License-Identifier: GPL-2.0-or-later
# Swing of learned models under a leaning hand, by the plan's verdict, over the device's damping.
set title "Learned models under 11 constant leans of the hand: widest swing, by the plan's verdict"
set xlabel 'damping of the device / (mN s/mm)'
set ylabel 'peak-to-peak swing in the last quarter of 8 s / mm'
set format y power
set xtics (5, 10, 20, 50)
eval key_below
least(y) = y < 2e-7 ? 2e-7 : y
# Cases of one damping stand next to each other, by mass and tracker.
beside(b, m, hz) = 1e3 * b * (1 + 2 * (m - 0.06) + (hz - 140) * 4e-4)
stats data using (least(column("swing_mm"))) nooutput
low = STATS_min
high = STATS_max > 0.01 ? STATS_max : 0.01
stats data using (1e3 * column("damping_N_s_mm")) nooutput
set yrange [low / 3:high * 3]
set xrange [STATS_min * 0.75:STATS_max * 1.35]
set logscale xy
set arrow from graph 0, first 0.01 to graph 1, first 0.01 nohead dt 2 lc rgb ink
set label 'limit: a larger swing is no rest' at graph 0.98, first 0.017 right font small
plot for [v in data_blocks] data index v \
	using (beside(column("damping_N_s_mm"), column("mass_kg"), column("tracker_hz"))):(least(column("swing_mm"))) \
	with points pt (v eq "accepted" ? 7 : 2) ps 0.7 lc rgb (v eq "accepted" ? green : vermillion) \
	title v
