// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/base/ascending.h: the median of odd and even counts. */
#include "../unit.h"
#include "../../../lib/base/ascending.h"

TEST(test_median)
{
	double odd[] = {5, -1, 3}, even[] = {4, 1, 3, 2}, one[] = {7};

	assert_true(median(odd, 3) == 3);
	assert_true(median(even, 4) == 2.5);
	assert_true(median(one, 1) == 7);
}
