/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * touch_failure NAME: ticks of examples/openhaptics around an error of the device, under a force of its user,
 * on a clock that stands still between ticks.
 */
#include <stdint.h>
#include <time.h>

static int64_t clock_ns = 1000000000;

static int read_clock(struct timespec *t)
{
	t->tv_sec = clock_ns / 1000000000;
	t->tv_nsec = clock_ns % 1000000000;
	return 0;
}

#define clock_gettime(id, t) read_clock(t)
#define main device_main
#include "../../examples/openhaptics/device.c"
#undef main

static HDCallbackCode tick(struct touch *touch)
{
	struct incise_haptic_page_user user;

	memset(&user, 0, sizeof(user));
	user.wants = INCISE_HAPTIC_PAGE_FORCE;
	user.heartbeat_ns = now_ns();
	user.period_ns = INCISE_HAPTIC_PAGE_PERIOD_NS;
	user.force_N[0] = 1;
	incise_haptic_page_put(&touch->owner.page->user, &user, sizeof(user));
	clock_ns += 1000000;
	return serve(touch);
}

static int has_force(void)
{
	return stub_mm[0] != 1;
}

/* 0: the tick with the error has no force and no sample, the next one is the last, without a force. */
int main(int argc, char **argv)
{
	static struct touch touch;
	uint64_t samples;
	int ok = argc == 2 && !owner_begin(&touch.owner, argv[1]);

	touch.peak_N = 3;
	for (int i = 0; i < 20 && ok; i++)
		ok = tick(&touch) == HD_CALLBACK_CONTINUE;
	ok = ok && has_force();
	samples = touch.owner.half.samples;
	stub_error = 0x301;
	ok = ok && tick(&touch) == HD_CALLBACK_CONTINUE && !has_force() &&
	     touch.owner.half.samples == samples;
	stub_error = HD_SUCCESS;
	ok = ok && tick(&touch) == HD_CALLBACK_DONE && !has_force() && touch.failed;
	owner_end(&touch.owner, INCISE_HAPTIC_PAGE_FAILED, "an error");
	return !ok;
}
