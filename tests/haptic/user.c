// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * user RIG TICKS [FORCE]: the user of a rig's haptic device, for tests. It pushes FORCE, N, along x at 1 kHz
 * for so many ticks that got a sample, and prints how many samples it took, the largest |x|, mm, and the
 * properties of the device. An error is its cause and its errno's name; it exits with 1 then.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/rig.h>

#define SAMPLES 32
#define PERIOD_NS 1000000

int main(int argc, char **argv)
{
	double force_N[3] = {argc > 3 ? atof(argv[3]) : 1, 0, 0}, most_mm = 0;
	long ticks = argc > 2 ? atol(argv[2]) : 0, done = 0, taken = 0;
	struct incise_haptic_sample samples[SAMPLES];
	struct incise_haptic_info info;
	struct incise_error err = {0};
	struct incise_haptic *haptic;
	struct incise_clock *clock;
	struct incise_rig *rig = incise_rig_open(argv[1], INCISE_RIG_HAPTIC, &err);
	char cause[500] = "";
	int64_t next_ns;
	int n = 0, rc = 0;

	if (!rig) {
		printf("%s: %s\n", strerrorname_np(err.code), err.text);
		return 1;
	}
	haptic = incise_rig_haptic(rig);
	clock = incise_rig_clock(rig);
	incise_haptic_info(haptic, &info);
	printf("%s, %g N, %g Hz, %g kg, %s\n", info.name, info.peak_N, info.rate_hz,
	       info.mass_kg, info.note);
	fflush(stdout);
	next_ns = incise_clock_now(clock);
	while (!rc && done < ticks) {
		int64_t now_ns = incise_clock_now(clock);

		next_ns = next_ns + PERIOD_NS > now_ns ? next_ns + PERIOD_NS : now_ns;
		incise_clock_wait_until(clock, next_ns);
		n = incise_haptic_read(haptic, samples, SAMPLES);
		rc = n < 0 ? n : incise_haptic_push(haptic, force_N, NULL);
		for (int i = 0; i < n; i++)
			most_mm = fmax(most_mm, fabs(samples[i].position_mm[0]));
		taken += n > 0 ? n : 0;
		done += n > 0;
		if (n > 0 && samples[n - 1].flags)
			incise_haptic_cause(haptic, cause, sizeof(cause));
	}
	if (rc)
		incise_haptic_cause(haptic, cause, sizeof(cause));
	printf("%ld samples, %llu lost, up to %.3f mm\n", taken,
	       (unsigned long long)incise_haptic_lost(haptic), most_mm);
	if (*cause)
		printf("%s: %s\n", rc ? strerrorname_np(-rc) : "flag", cause);
	incise_rig_close(rig);
	return rc ? 1 : 0;
}
