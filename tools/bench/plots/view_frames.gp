# SPDX-License-Identifier: GPL-2.0-or-later
# Times of frames by texture, median and 99 %, a pair of lines for each width of the picture; and the
# period of 50 Hz, the visual rate of paper 1.
set title "Time of a frame of a cut that bleeds: median, and dashed 99 %" font large
set logscale x 2
set xlabel 'side of the texture / texels'
set ylabel 'whole frame / ms'
set xrange [360:5800]
set yrange [0:*]
set key top left
plot 20 with lines lw 2 lc rgb vermillion title '50 Hz', \
	for [i=1:words(data_blocks)] data index word(data_blocks, i) \
		using "texture_px":"whole_median_ms" with linespoints ls i pt 7 ps 0.9 \
		title sprintf("%s pixels wide", word(data_blocks, i)), \
	for [i=1:words(data_blocks)] data index word(data_blocks, i) \
		using "texture_px":"whole_p99_ms" with linespoints ls i dt 2 pt 6 ps 0.9 notitle
