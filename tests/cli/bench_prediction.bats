# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench prediction: new cuts on new rigs within the interval. The campaign of the benchmark itself
# has 180 models; here are 8.

load cli
load report

@test "bench prediction: the interval holds new cuts on new rigs, and calibration is a part of it" {
	work_folder
	quick_report prediction
	[ "$(of rows 'count(*)')" = 2 ]
	[ "$(of rows 'count(*)' 'failed IS NOT NULL')" = 0 ]
	# Of 4 models: their shares scatter by about 3 %, so their mean by 1.5 %; 95 less two of that.
	holds "$(of rows 'min(covered_percent)') > 92"
	# With one rig its own calibration is there in full; it averages out over three.
	holds "$(of rows sd_calibration_N 'rigs = 1') > 1.1 * $(of rows sd_calibration_N 'rigs = 3')"
	holds "$(of rows sd_calibration_N 'rigs = 3') > 0.2 * $(of rows sd_N 'rigs = 3')"
	# An interval that knows no calibration holds less.
	holds "$(of rows 'min(covered_percent - without_percent)') > 0"
}
