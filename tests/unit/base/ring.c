// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/ring.c: order, what is full, counts that wrap round the array, and two threads.
 */
#include "../unit.h"
#include <pthread.h>
#include <sched.h>
#include "../../../lib/base/ring.h"

/* Three words of one value: a torn record shows. */
struct record {
	uint64_t a, b, c;
};

static struct record of(uint64_t i)
{
	return (struct record){i, ~i, i * 3};
}

static void is(const struct record *r, uint64_t i)
{
	assert_int_equal(r->a, i);
	assert_int_equal(r->b, ~i);
	assert_int_equal(r->c, i * 3);
}

TEST(refuses)
{
	struct incise_ring ring;

	assert_int_equal(incise_ring_init(&ring, 0, 1), -EINVAL);
	assert_int_equal(incise_ring_init(&ring, 1, 0), -EINVAL);
	assert_int_equal(incise_ring_init(&ring, 1, SIZE_MAX), -EINVAL);
	assert_int_equal(incise_ring_init(&ring, SIZE_MAX / 2, 8), -ENOMEM);
}

TEST(in_order_and_counted_when_full)
{
	struct incise_ring ring;
	struct record records[10];
	uint64_t in = 0, out = 0;

	/* 5 records become room for 8. */
	assert_int_equal(incise_ring_init(&ring, sizeof(struct record), 5), 0);
	assert_int_equal(incise_ring_take(&ring, records, 10), 0);
	/* Many times round, each time with another number in it. */
	for (int round = 0; round < 100; round++) {
		int n = 1 + round % 8, taken;

		for (int i = 0; i < n; i++) {
			struct record r = of(in++);

			assert_true(incise_ring_put(&ring, &r));
		}
		taken = incise_ring_take(&ring, records, round % 3 ? 10 : n);
		assert_int_equal(taken, n);
		for (int i = 0; i < taken; i++)
			is(&records[i], out++);
	}
	assert_int_equal(incise_ring_dropped(&ring), 0);
	for (int i = 0; i < 11; i++) {
		struct record r = of((uint64_t)i);

		assert_int_equal(incise_ring_put(&ring, &r), i < 8);
	}
	assert_int_equal(incise_ring_dropped(&ring), 3);
	assert_int_equal(incise_ring_take(&ring, records, 3), 3);
	is(&records[0], 0);
	is(&records[2], 2);
	assert_int_equal(incise_ring_take(&ring, records, 0), 0);
	assert_int_equal(incise_ring_take(&ring, records, -1), 0);
	assert_int_equal(incise_ring_take(&ring, records, 10), 5);
	is(&records[4], 7);
	incise_ring_free(&ring);
}

#define SENT 200000

static void *write_all(void *argument)
{
	struct incise_ring *ring = argument;

	for (uint64_t i = 0; i < SENT; i++) {
		struct record r = of(i);

		incise_ring_put(ring, &r);
		if (i % 64 == 0)
			sched_yield();
	}
	return NULL;
}

/* Whatever is taken is whole and in order, and what is missing is what was dropped. */
TEST(between_two_threads)
{
	struct incise_ring ring;
	struct record records[16];
	uint64_t taken = 0, next = 0;
	pthread_t thread;
	bool ended = false;

	assert_int_equal(incise_ring_init(&ring, sizeof(struct record), 64), 0);
	assert_int_equal(pthread_create(&thread, NULL, write_all, &ring), 0);
	for (;;) {
		int n = incise_ring_take(&ring, records, 16);

		for (int i = 0; i < n; i++) {
			assert_true(records[i].a >= next);
			is(&records[i], records[i].a);
			next = records[i].a + 1;
		}
		taken += (uint64_t)n;
		if (n)
			continue;
		if (ended)
			break;
		if (taken + incise_ring_dropped(&ring) == SENT) {
			pthread_join(thread, NULL);
			ended = true;
		}
		sched_yield();
	}
	assert_int_equal(taken + incise_ring_dropped(&ring), SENT);
	assert_true(taken > 0);
	incise_ring_free(&ring);
}
