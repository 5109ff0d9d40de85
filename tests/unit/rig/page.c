// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/page.c: what is read is one that was written, whole, and nothing that makes
 * no sense comes through; with a thread on the other side too.
 */
#include "../unit.h"
#include <pthread.h>
#include <stdatomic.h>
#include "../../../lib/fixed/profile.h"
#include "../../../lib/rig/page.h"

TEST(a_set_point_is_taken_once)
{
	struct incise_stepper_setpoint slot = {.seq = 4}, copy;
	uint32_t seq = 4;

	assert_int_equal(incise_page_get_setpoint(&slot, &seq, &copy), 0);
	incise_page_put_setpoint(&slot, INCISE_STEPPER_MODE_VELOCITY, -77, 123456789012);
	assert_int_equal(slot.seq, 6);
	assert_int_equal(incise_page_get_setpoint(&slot, &seq, &copy), 1);
	assert_int_equal(seq, 6);
	assert_int_equal(copy.mode, INCISE_STEPPER_MODE_VELOCITY);
	assert_int_equal(copy.target, -77);
	assert_true(copy.t_ns == 123456789012);
	assert_int_equal(incise_page_get_setpoint(&slot, &seq, &copy), 0);
	/* Being written for ever: nothing, for ever. The next owner heals it. */
	slot.seq = 9;
	assert_int_equal(incise_page_get_setpoint(&slot, &seq, &copy), 0);
	incise_page_put_setpoint(&slot, INCISE_STEPPER_MODE_POSITION, 5, 1);
	assert_int_equal(slot.seq, 10);
	assert_int_equal(incise_page_get_setpoint(&slot, &seq, &copy), 1);
	/* Round the end of 32 bits. */
	slot.seq = UINT32_MAX - 1;
	incise_page_put_setpoint(&slot, INCISE_STEPPER_MODE_POSITION, 6, 1);
	assert_int_equal(slot.seq, 0);
	assert_int_equal(incise_page_get_setpoint(&slot, &seq, &copy), 1);
	assert_int_equal(copy.target, 6);
}

TEST(garbage_in_a_set_point_is_told_once)
{
	for (int i = 0; i < 3; i++) {
		struct incise_stepper_setpoint slot = {.seq = 2}, copy;
		uint32_t seq = 0;

		if (i == 0)
			slot.mode = 2;
		else if (i == 1)
			slot.reserved0 = 1;
		else
			slot.reserved[4] = 1;
		assert_int_equal(incise_page_get_setpoint(&slot, &seq, &copy), -EINVAL);
		assert_int_equal(incise_page_get_setpoint(&slot, &seq, &copy), 0);
	}
}

TEST(a_status_must_make_sense)
{
	const struct incise_stepper_motor_status good = {
		.seq = 8,
		.state = INCISE_STEPPER_STATE_FAULT,
		.faults = INCISE_STEPPER_FAULT_LINE | INCISE_STEPPER_FAULT_DEADMAN,
		.inputs = INCISE_STEPPER_LINE_ALARM,
		.position = -2LL * INCISE_PROFILE_POSITION_MAX,
		.velocity = (int64_t)INCISE_PROFILE_VELOCITY_MAX << 16,
	};
	struct incise_stepper_motor_status slot = good, copy;

	assert_int_equal(incise_page_get_status(&slot, &copy), 0);
	assert_memory_equal(&copy, &good, sizeof(copy));
	for (int i = 0; i < 6; i++) {
		slot = good;
		if (i == 0)
			slot.state = INCISE_STEPPER_STATE_FAULT + 1;
		else if (i == 1)
			slot.faults = INCISE_STEPPER_FAULT_TRAVEL; /* never in a page */
		else if (i == 2)
			slot.inputs = INCISE_STEPPER_LINE_ENABLE;
		else if (i == 3)
			slot.position = INT64_MIN;
		else if (i == 4)
			slot.velocity = INT64_MAX;
		else
			slot.home_position = INT64_MAX;
		copy = (struct incise_stepper_motor_status){.t_ns = 42};
		assert_int_equal(incise_page_get_status(&slot, &copy), -EIO);
		assert_int_equal(copy.t_ns, 42);
	}
	slot = good;
	slot.seq = 7;
	assert_int_equal(incise_page_get_status(&slot, &copy), -EAGAIN);
	assert_int_equal(copy.t_ns, 42);
	incise_page_put_status(&slot, &good);
	assert_int_equal(slot.seq, 8);
	assert_int_equal(incise_page_get_status(&slot, &copy), 0);
	assert_int_equal(copy.t_ns, good.t_ns);
}

#define WRITES 200000

struct shared {
	struct incise_stepper_motor_status slot;
	atomic_int differing; /* copies that differ from the one before */
	int writes;
	atomic_bool done;
};

/* Every field is the same number, which a torn copy would not be. */
static void *write_many(void *argument)
{
	struct shared *s = argument;

	for (int i = 1; i <= WRITES || atomic_load(&s->differing) < 100; i++) {
		struct incise_stepper_motor_status status = {.t_ns = i,
							     .position = i,
							     .velocity = i,
							     .target = i,
							     .home_position = i,
							     .steps_up = i,
							     .late = i,
							     .shifted_ns = i};

		incise_page_put_status(&s->slot, &status);
		s->writes = i;
	}
	atomic_store(&s->done, true);
	return NULL;
}

TEST(a_copy_is_never_torn)
{
	static struct shared s;
	struct incise_stepper_motor_status copy = {0};
	int64_t last = 0;
	pthread_t thread;

	assert_int_equal(pthread_create(&thread, NULL, write_many, &s), 0);
	while (!atomic_load(&s.done)) {
		int rc = incise_page_get_status(&s.slot, &copy);

		assert_true(rc == 0 || rc == -EAGAIN);
		assert_true(copy.position == copy.t_ns && copy.velocity == copy.t_ns &&
			    copy.target == copy.t_ns && copy.home_position == copy.t_ns);
		assert_true((int64_t)copy.steps_up == copy.t_ns &&
			    (int64_t)copy.late == copy.t_ns &&
			    (int64_t)copy.shifted_ns == copy.t_ns);
		/* Neither is it older than the one before. */
		assert_true(copy.t_ns >= last);
		if (copy.t_ns > last)
			atomic_fetch_add(&s.differing, 1);
		last = copy.t_ns;
	}
	pthread_join(thread, NULL);
	assert_int_equal(incise_page_get_status(&s.slot, &copy), 0);
	assert_int_equal(copy.t_ns, s.writes);
}
