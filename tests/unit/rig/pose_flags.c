// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/pose_flags.c: which flags make a pose unusable, and how they are counted. The
 * lists are those of rig.conf(5).
 */
#include "../unit.h"
#include <incise/tracker.h>

TEST(only_some_flags_leave_a_pose_usable)
{
	for (int status = -128; status < 128; status++) {
		bool usable = !status || (status > 0 && strchr(" mtuvw", status));

		assert_int_equal(incise_pose_usable((char)status), usable);
		assert_true(*incise_pose_flag((char)status));
	}
}

TEST(flags_are_counted_and_named)
{
	struct incise_pose_counts counts = {0}, sum = {0};
	char text[400], some[20];
	int length;

	incise_pose_count(&counts, ' ');
	incise_pose_count(&counts, 0);
	assert_int_equal(incise_pose_counts_text(&counts, text, sizeof(text)), 0);
	assert_string_equal(text, "");
	for (int i = 0; i < 3; i++)
		assert_false(incise_pose_count(&counts, 'x'));
	assert_true(incise_pose_count(&counts, 'u'));
	assert_false(incise_pose_count(&counts, (char)0xe4));
	assert_int_equal(counts.poses, 7);
	assert_int_equal(counts.unusable, 4);
	length = incise_pose_counts_text(&counts, text, sizeof(text));
	assert_int_equal(length, strlen(text));
	assert_string_equal(
		text,
		"4 of 7 poses were not used: 1 '?' (its self-test found an error), 3 "
		"'x' (the sensor is outside its motion box); 1 of 7 poses are "
		"doubtful: 1 'u' (outside its map of the distortion by metal)");
	/* As snprintf(): whatever the room is. */
	for (size_t size = 0; size <= sizeof(some); size++) {
		memset(some, '#', sizeof(some));
		assert_int_equal(incise_pose_counts_text(&counts, some, size), length);
		if (size)
			assert_int_equal(strlen(some), size - 1);
		for (size_t i = size; i < sizeof(some); i++)
			assert_int_equal(some[i], '#');
	}
	incise_pose_counts_add(&sum, &counts);
	incise_pose_counts_add(&sum, &counts);
	assert_int_equal(sum.poses, 14);
	assert_int_equal(sum.unusable, 8);
	assert_int_equal(sum.flagged['x'], 6);
}
