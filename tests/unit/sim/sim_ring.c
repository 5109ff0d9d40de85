// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/sim_ring.c: order, room, and what gives way when there is none.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "../../../lib/sim/world.h"

static void order_room_and_loss(void **state)
{
	struct incise_sim_ring ring;
	int next = 0, expected = 0, taken = 0;

	assert_int_equal(incise_sim_ring_init(&ring, sizeof(int), 4, 0.25), 0);
	/* 4 Hz for 2.5 s and 0.25 s more. */
	assert_true(ring.room >= 11);
	assert_null(incise_sim_ring_peek(&ring));
	/* Several times round, taking fewer than come, then all. */
	for (int round = 0; round < 10; round++) {
		for (int i = 0; i < 7; i++, next++)
			incise_sim_ring_push(&ring, &next);
		for (int i = 0; i < 5; i++) {
			int value = *(const int *)incise_sim_ring_peek(&ring);

			/* Gaps only forward, and each one counted. */
			assert_true(value >= expected);
			expected = value + 1;
			taken++;
			incise_sim_ring_pop(&ring);
		}
	}
	while (incise_sim_ring_peek(&ring)) {
		expected = *(const int *)incise_sim_ring_peek(&ring) + 1;
		taken++;
		incise_sim_ring_pop(&ring);
	}
	assert_int_equal(expected, next); /* the newest is never the one to go */
	assert_true(ring.lost > 0);
	assert_int_equal(taken + ring.lost, next);
	incise_sim_ring_free(&ring);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(order_room_and_loss),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
