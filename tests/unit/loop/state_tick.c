// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/state_tick.c: a tick there and back, and what is none.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include "../../../lib/loop/state_page.h"
#include "state_made.h"

static void test_there_and_back(void **state)
{
	for (int64_t n = 0; n < 5000; n++) {
		struct incise_tick tick = made_tick(n), back;
		struct state_tick packed;

		/* Nothing of it may be left from before. */
		memset(&packed, 0xee, sizeof(packed));
		memset(&back, 0xee, sizeof(back));
		incise_state_pack(&packed, &tick);
		assert_int_equal(incise_state_unpack(&back, &packed), 0);
		assert_true(made_same(&back, &tick));
	}
}

static void test_what_is_no_tick(void **state)
{
	struct incise_tick tick = made_tick(7), back;
	struct state_tick packed;

	incise_state_pack(&packed, &tick);
	packed.phase = INCISE_PHASE_INSERTION + 1;
	assert_int_equal(incise_state_unpack(&back, &packed), -EIO);
	packed.phase = 0;
	packed.tool = INCISE_TOOL_TUBE + 1;
	assert_int_equal(incise_state_unpack(&back, &packed), -EIO);
	packed.tool = 0;
	/* Flags of a later release are not known here. */
	packed.flags = ~0u;
	assert_int_equal(incise_state_unpack(&back, &packed), 0);
	assert_int_equal(back.flags, (1 << INCISE_TICK_FLAGS) - 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_there_and_back),
		cmocka_unit_test(test_what_is_no_tick),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
