# SPDX-License-Identifier: GPL-2.0-or-later
# Times of frames by texture, median and 99 %, a pair of lines for each width of the image; and the
# period of 50 Hz, the visual rate of Song et al.
n = words(data_blocks)
set title "Time to draw one frame of a bleeding cut\nsolid: median; dashed: 99th percentile"
set xlabel 'side of the texture / texel'
set ylabel 'time of a whole frame / ms'
stats data using "texture_px" nooutput
set xrange [STATS_min / 1.4:STATS_max * 1.4]
set logscale x 2
set yrange [0:*]
eval key_below
plot 20 with lines lw 1.5 dt 3 lc rgb ink title 'period of 50 Hz', \
	for [i=1:n] data index word(data_blocks, i) \
		using "texture_px":"whole_median_ms" with linespoints lt i \
		title sprintf("image %s px wide", word(data_blocks, i)), \
	for [i=1:n] data index word(data_blocks, i) \
		using "texture_px":"whole_p99_ms" with linespoints lt i dt 2
