// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What the kernel module believes of a user: bytes become the self-test's figures, a config
 * and slots of a page. A config that is let pass must be one that the profile takes, or
 * refuses for its jerk alone; a target that is taken lies within its limits, and however
 * they follow each other, no step leaves them.
 *
 *   rate_max 4 · pulse_ns 4 · config 128 · begin 4, then slots of 64
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../../driver/stepper_page.c"

static void require(bool true_of)
{
	if (!true_of)
		abort();
}

static void walk(const struct incise_stepper_config *c, struct incise_profile *profile,
		 const uint8_t *data, size_t size)
{
	struct incise_profile_slot steps;
	struct stepper_wish wish = {0};

	for (; size >= 64; data += 64, size -= 64) {
		struct incise_stepper_setpoint slot;
		int64_t target;

		memcpy(&slot, data, sizeof(slot));
		if (stepper_page_take(&slot, &wish) != STEPPER_PAGE_TAKEN)
			continue;
		target = stepper_page_clamp(&wish, c);
		if (wish.mode == INCISE_STEPPER_MODE_POSITION)
			require(target >= c->position_min && target <= c->position_max);
		else
			require(llabs(target) <= c->velocity);
		require(incise_profile_target(profile,
					      wish.mode == INCISE_STEPPER_MODE_POSITION
						      ? INCISE_PROFILE_POSITION
						      : INCISE_PROFILE_VELOCITY,
					      target) == target);
		for (int i = 0; i < 20; i++) {
			incise_profile_tick(profile, &steps);
			require(incise_profile_position(profile) >= c->position_min &&
				incise_profile_position(profile) <= c->position_max);
		}
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct incise_stepper_info info = {.n_motors = 8};
	struct incise_stepper_config c;
	struct incise_profile profile;
	struct incise_profile_limits limits;
	int32_t begin;
	int rc;

	if (size < 8 + sizeof(c) + 4)
		return 0;
	memcpy(&info.rate_max, data, 4);
	memcpy(&info.pulse_ns, data + 4, 4);
	memcpy(&c, data + 8, sizeof(c));
	memcpy(&begin, data + 8 + sizeof(c), 4);
	if (stepper_page_config(&c, &info))
		return 0;
	limits = (struct incise_profile_limits){
		.tick_ns = c.tick_ns,
		.velocity = c.velocity,
		.acceleration = c.acceleration,
		.position_min = c.position_min,
		.position_max = c.position_max,
		.jerk = c.jerk,
	};
	rc = incise_profile_init(&profile, &limits, c.position_min);
	require(rc == 0 || (rc == -ERANGE && c.jerk));
	if (!rc && begin >= c.position_min && begin <= c.position_max)
		incise_profile_halt(&profile, begin);
	if (!rc)
		walk(&c, &profile, data + 8 + sizeof(c) + 4, size - 8 - sizeof(c) - 4);
	return 0;
}
