// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A force channel on comedi_test: 20000 samples in order, an overflow on purpose, clipping,
 * refusals.
 *
 *   force_comedi sawtooth | clipped
 *
 * Channel 0 is a sawtooth of 0.1 s that follows CLOCK_MONOTONIC: a code shows when it was
 * converted, modulo 0.1 s.
 *
 *   code  ▲   ╱│  ╱│        from -A to A in 100 ms: at A = 1 V of ±10 V one code is 15 us
 *         │ ╱  │╱  │
 *         └────┴───┴──▶ CLOCK_MONOTONIC
 */
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <comedilib.h>
#include "../../../lib/rig/backends.h"
#include "../hold.h"
#include "../tap.h"

extern const struct incise_backend incise_force_comedi;

#define DEVICE "/dev/comedi0:0"
#define HZ 10000
#define MANY 20000
#define SAW_US 100000.0
#define MAXDATA 65535
#define SWING (MAXDATA / 20) /* codes of 1 V on a range of 20 V, rounded down */

static struct incise_force_sample samples[8 * MANY];
static bool virtual_time;

static void nap(int ms)
{
	poll(NULL, 0, ms);
}

static struct incise_force *open_force(const char *device, int channel, double rate_hz,
				       double full_scale_V, struct incise_error *err)
{
	struct incise_force_setup setup = {
		.rate_hz = rate_hz, .channel = channel, .full_scale_V = full_scale_V};
	struct incise_backend_request request = {
		.arguments = device, .where = "test: force", .force = &setup};

	*err = (struct incise_error){0};
	return incise_force_comedi.open(&request, err);
}

static int take(struct incise_force *force, int n)
{
	int have = 0, quiet = 0, rc;

	while (have < n && quiet < 5000) {
		rc = incise_force_read(force, samples + have, n - have);
		if (rc < 0)
			break;
		have += rc;
		quiet = rc ? 0 : quiet + 2;
		if (!rc)
			nap(2);
	}
	return have;
}

/* When in the 0.1 s it was converted, us. */
static double phase_us(int32_t code)
{
	return (code - (MAXDATA / 2 - SWING)) * SAW_US / (2.0 * SWING);
}

/* The least distance on the circle of 0.1 s. */
static double apart_us(double a, double b)
{
	return remainder(a - b, SAW_US);
}

/* Largest distance of a code from the time that seq gives, us. */
static double disorder_us(int n)
{
	double most = 0;

	for (int i = 1; i < n; i++) {
		double steps = (double)(samples[i].seq - samples[0].seq);

		most = fmax(most, fabs(apart_us(phase_us(samples[i].code) -
							phase_us(samples[0].code),
						steps * 1e6 / HZ)));
	}
	return most;
}

/* Distance of timestamps from the conversion, us. */
static void stamps_off(int n, double *least, double *most)
{
	*least = INFINITY;
	*most = -INFINITY;
	for (int i = 0; i < n; i++) {
		double off = apart_us((double)samples[i].t_ns / 1e3,
				      phase_us(samples[i].code));

		*least = fmin(*least, off);
		*most = fmax(*most, off);
	}
}

static void two_seconds(void)
{
	struct incise_force_info info;
	struct incise_force *force;
	struct incise_error err;
	double least, most, disorder;
	bool order = true;
	int n;

	force = open_force(DEVICE, 0, HZ, 0, &err);
	if (!check(force, "it opens %s", err.text))
		return;
	n = take(force, MANY);
	incise_force_info(force, &info);
	for (int i = 0; i < n; i++)
		order &= samples[i].seq == (uint64_t)i &&
			 (!i || samples[i].t_ns > samples[i - 1].t_ns);
	disorder = disorder_us(n);
	stamps_off(n, &least, &most);
	note("%s, %g Hz, %d bits, %.6g V from %g V", info.name, info.rate_hz, info.bits,
	     info.full_scale_V, info.offset_V);
	note("%d samples, codes within %.1f us of their number, stamps %.0f to %.0f us from "
	     "the conversion, lost %llu",
	     n, disorder, least, most, (unsigned long long)incise_force_lost(force));
	check(info.rate_hz == HZ && info.bits == 16 && info.offset_V == -10 &&
		      fabs(info.full_scale_V - 20) < 1e-3,
	      "10 kHz, 16 bits, 20 V from -10 V");
	/* Two codes of 15 us, each rounded. */
	if (virtual_time || !info.overflows)
		check(n == MANY && order && !incise_force_lost(force) && disorder < 31,
		      "%d of %d samples in order, each of its own time", n, MANY);
	check(!info.clipped, "none is clipped");
	/* The start of the command is known to some microseconds. */
	if (virtual_time)
		check(least > -1000 && most < 1000,
		      "in virtual time stamps are within 1 ms of the conversion");
	force->ops->close(force);
}

/* Samples that the kernel has room for. */
static int kernel_room(void)
{
	comedi_t *device = comedi_open("/dev/comedi0");
	int bytes = device ? comedi_get_buffer_size(device, 0) : 0;

	if (device)
		comedi_close(device);
	return bytes / (int)sizeof(sampl_t);
}

/*
 * Held for 8 s, for which the kernel has no room: the command ends there, and what would have
 * come until it is started again is lost.
 */
static void overflow_is_counted(void)
{
	struct incise_force_info info;
	struct incise_force *force;
	struct incise_error err;
	uint64_t gaps = 0, missing = 0;
	int n;

	force = open_force(DEVICE, 0, HZ, 0, &err);
	if (!check(force, "it opens for an overflow %s", err.text))
		return;
	take(force, HZ);
	hold_ms(8000);
	n = take(force, 10 * HZ);
	incise_force_info(force, &info);
	for (int i = 1; i < n; i++) {
		uint64_t step = samples[i].seq - samples[i - 1].seq;

		gaps += step != 1;
		missing += step - 1;
	}
	note("held for 8 s, room for %d samples: %llu overflow, %llu samples lost, %d came; across it the sawtooth "
	     "is %.0f us from seq",
	     kernel_room(), (unsigned long long)info.overflows,
	     (unsigned long long)incise_force_lost(force), n, disorder_us(n));
	if (virtual_time)
		check(info.overflows == 1 && gaps == 1 &&
			      missing == incise_force_lost(force) &&
			      missing >= (uint64_t)(8 * HZ - kernel_room()),
		      "one overflow is counted once, and sampling goes on");
	else
		check(info.overflows >= 1 && incise_force_lost(force) > 0,
		      "an overflow is told, and sampling goes on");
	/* By the clock only: a few samples more or less. */
	if (virtual_time)
		check(disorder_us(n) < 1000, "the gap in seq is true to 10 samples");
	force->ops->close(force);
}

static void refusals(void)
{
	static const struct {
		const char *device;
		int channel;
		double rate_hz, full_scale_V;
		int code;
		const char *says;
	} cases[] = {
		{"/dev/comedi9:0", 0, HZ, 0, ENOENT, "load the driver of your card"},
		{"/dev/comedi0:1", 0, HZ, 0, EOPNOTSUPP, "is not an analogue input"},
		{"comedi0", 0, HZ, 0, EINVAL, "expected comedi:DEVICE:SUBDEVICE"},
		{DEVICE, 8, HZ, 0, EINVAL, "has channels 0 to 7"},
		{DEVICE, 0, HZ, 100, ERANGE, "(ranges in V: -10 to 10, -5 to 5)"},
		{DEVICE, 0, 98765.4, 0, EINVAL, "the nearest is 100000 Hz"},
	};
	struct incise_force *force, *second;
	struct incise_error err;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		errno = 0;
		force = open_force(cases[i].device, cases[i].channel, cases[i].rate_hz,
				   cases[i].full_scale_V, &err);
		check(!force && errno == cases[i].code && strstr(err.text, cases[i].says),
		      "refused: %s", err.text);
	}
	force = open_force(DEVICE, 0, HZ, 0, &err);
	second = open_force(DEVICE, 0, HZ, 0, &err);
	check(force && !second && err.code == EBUSY, "a second one: %s", err.text);
	if (force)
		force->ops->close(force);
}

static int found(void *context, const struct incise_scan_device *device)
{
	note("%s: %s", device->device, device->what);
	for (int i = 0; i < device->n; i++)
		note("  %s = %s", device->property[i].key, device->property[i].text);
	*(int *)context += device->usable && !strcmp(device->device, "comedi:" DEVICE);
	return 0;
}

static void clipping(void)
{
	uint64_t low = 0, high = 0;
	struct incise_force_info info;
	struct incise_force *force;
	struct incise_error err;
	int n;

	force = open_force("/dev/comedi0", 0, HZ, 10, &err);
	if (!check(force, "without a subdevice, the range of 10 V %s", err.text))
		return;
	n = take(force, MANY);
	incise_force_info(force, &info);
	for (int i = 0; i < n; i++) {
		low += samples[i].code == 0;
		high += samples[i].code == MAXDATA;
	}
	note("clipped %llu; %llu at the bottom and %llu at the top of %d samples",
	     (unsigned long long)info.clipped, (unsigned long long)low,
	     (unsigned long long)high, n);
	check(info.offset_V == -5 && low > 100 && high > 100 &&
		      info.clipped >= low + high && info.clipped < low + high + 2000,
	      "both ends are clipped, and counted");
	force->ops->close(force);
}

int main(int argc, char **argv)
{
	const char *profile = getenv("INCISE_VM_PROFILE");
	struct incise_error err = {0};
	int listed = 0;

	virtual_time = profile && !strcmp(profile, "deterministic");
	memset(samples, 1, sizeof(samples));
	mlockall(MCL_CURRENT | MCL_FUTURE);
	if (argc > 1 && !strcmp(argv[1], "clipped")) {
		clipping();
		return tap_failures != 0;
	}
	check(!incise_force_comedi.scan("", found, &listed, &err) && listed == 1,
	      "it is listed once");
	two_seconds();
	overflow_is_counted();
	refusals();
	return tap_failures != 0;
}
