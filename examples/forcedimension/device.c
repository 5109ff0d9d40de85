// not compiled against the real headers, not run against the real thing
// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * device NAME PEAK_N: an omega, delta, sigma or lambda of Force Dimension for `--rig local:NAME`.
 *
 *     cc -D_GNU_SOURCE device.c -ldhd -lm -o device     with the SDK 3.x; by c++ where its header is
 *     ./device omega 12                                 C++, by its default arguments
 *
 * The names are those of the SDK's public documentation (metres, newtons). PEAK_N is the largest force by the
 * device's data sheet, which the SDK does not tell. The device is initialised by hand, as its manual says.
 */
#include <signal.h>
#include <stdlib.h>
#include <dhdc.h>
#include "../haptic_page/owner.h"

#define PERIOD_NS 1000000
#define ID (-1) /* the device that dhdOpen() opened */

static volatile sig_atomic_t stop;

static void ask_end(int number)
{
	stop = number;
}

/* One sample in mm. 0, or -1: the device does not answer. */
static int read_device(struct incise_haptic_page_sample *sample)
{
	double *p = sample->position_mm, *v = sample->velocity_mm_s;
	double frame[3][3];
	int i;

	if (dhdGetPosition(&p[0], &p[1], &p[2], ID) < 0 ||
	    dhdGetLinearVelocity(&v[0], &v[1], &v[2], ID) < 0 ||
	    dhdGetOrientationFrame(frame, ID) < 0)
		return -1;
	for (i = 0; i < 3; i++) {
		p[i] *= 1000;
		v[i] *= 1000;
	}
	quaternion_of((const double(*)[3])frame, sample->quaternion);
	sample->buttons = dhdGetButtonMask(ID);
	return 0;
}

/* Returns why it ended; NULL: it was asked to. */
static const char *serve(struct owner *owner, double peak_N)
{
	struct incise_haptic_page_sample sample;
	int64_t at = now_ns();
	struct timespec next;
	double force_N[3];

	memset(&sample, 0, sizeof(sample));
	while (!stop) {
		if (read_device(&sample))
			return dhdErrorGetLastStr();
		owner_sample(owner, &sample);
		owner_force(owner, peak_N, force_N);
		if (dhdSetForce(force_N[0], force_N[1], force_N[2], ID) < 0)
			return dhdErrorGetLastStr();
		at += PERIOD_NS;
		next.tv_sec = at / 1000000000;
		next.tv_nsec = at % 1000000000;
		clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
	}
	return NULL;
}

int main(int argc, char **argv)
{
	struct incise_haptic_info *device;
	struct owner owner;
	const char *why;

	if (argc != 3 || !(atof(argv[2]) > 0)) {
		fprintf(stderr, "usage: %s NAME PEAK_N\n", argv[0]);
		return 2;
	}
	if (dhdOpen() < 0) {
		fprintf(stderr, "no device: %s\n", dhdErrorGetLastStr());
		return 1;
	}
	if (owner_begin(&owner, argv[1])) {
		dhdClose(ID);
		return 1;
	}
	signal(SIGTERM, ask_end);
	signal(SIGINT, ask_end);
	device = &owner.page->device;
	snprintf(device->name, sizeof(device->name), "%s", dhdGetSystemName(ID));
	snprintf(device->note, sizeof(device->note),
		 "initialised by hand; give its workspace as low_mm and high_mm");
	device->rate_hz = 1e9 / PERIOD_NS;
	device->peak_N = atof(argv[2]);
	device->buttons = 1;
	device->features = INCISE_HAPTIC_PAGE_VELOCITY | INCISE_HAPTIC_PAGE_ORIENTATION |
			   INCISE_HAPTIC_PAGE_GRAVITY;
	dhdSetGravityCompensation(DHD_ON, ID);
	dhdEnableForce(DHD_ON, ID);
	why = serve(&owner, device->peak_N);
	dhdSetForce(0, 0, 0, ID);
	dhdEnableForce(DHD_OFF, ID);
	dhdClose(ID);
	owner_end(&owner, why ? INCISE_HAPTIC_PAGE_FAILED : INCISE_HAPTIC_PAGE_ENDED,
		  why ? why : "stopped; start it again");
	return why != NULL;
}
