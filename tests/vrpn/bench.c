// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The backend vrpn in its owner's loop for some seconds, against tests/vrpn/server.cc: poses in
 * time, ages, and forces, which the server prints.
 *
 *   bench NAME@HOST:PORT SECONDS
 */
#include <stdio.h>
#include <stdlib.h>
#include <incise/backend.h>

static int compare(const void *a, const void *b)
{
	const double *x = a, *y = b;

	return (*x > *y) - (*x < *y);
}

int main(int argc, char **argv)
{
	const struct incise_haptic_setup setup = {.peak_N = 10};
	struct incise_clock *clock = incise_clock_new_real();
	struct incise_haptic_sample samples[64];
	struct incise_error err = {0};
	struct incise_haptic_info info;
	struct incise_haptic *haptic;
	double *ages_ms, seconds = argc > 2 ? atof(argv[2]) : 1;
	char text[300];
	int64_t start_ns, last_ns = 0;
	size_t n = 0, late = 0, most;
	double force_N[3] = {0};

	snprintf(text, sizeof(text), "vrpn:%s", argc > 1 ? argv[1] : "");
	haptic = incise_haptic_open(text, "bench", &setup, clock, &err);
	if (!haptic) {
		fprintf(stderr, "%s\n", err.text);
		return 1;
	}
	incise_haptic_info(haptic, &info);
	printf("%s: %.1f Hz, latency %.3f ms, %d buttons; %s\n", info.name, info.rate_hz,
	       (double)info.latency_ns * 1e-6, info.buttons, info.note);
	most = (size_t)(seconds * info.rate_hz * 1.1) + 64;
	ages_ms = calloc(most, sizeof(*ages_ms));
	start_ns = incise_clock_now(clock);
	while (incise_clock_now(clock) - start_ns < (int64_t)(seconds * 1e9)) {
		int got;

		haptic->ops->wait(haptic, 1000000);
		got = incise_haptic_read(haptic, samples, 64);
		if (got < 0) {
			incise_haptic_cause(haptic, text, sizeof(text));
			fprintf(stderr, "%s\n", text);
			break;
		}
		for (int i = 0; i < got && n < most; i++) {
			int64_t now_ns = incise_clock_now(clock);

			/* In time: used within a period of when it was taken. */
			ages_ms[n++] = (double)(now_ns - samples[i].t_ns) * 1e-6;
			late += ages_ms[n - 1] > 1e3 / info.rate_hz;
			last_ns = samples[i].t_ns;
		}
		if (!got)
			continue;
		/* A wall of 0.1 N/mm at z = 0. */
		force_N[2] = samples[got - 1].position_mm[2] < 0
				     ? -0.1 * samples[got - 1].position_mm[2]
				     : 0;
		incise_haptic_push(haptic, force_N, NULL);
	}
	qsort(ages_ms, n, sizeof(*ages_ms), compare);
	if (n)
		printf("%zu poses, %llu lost, %zu older than a period (%.4f %%); age median "
		       "%.3f ms, 99 %% %.3f ms, 99.9 %% %.3f ms, most %.3f ms; last %.3f s\n",
		       n, (unsigned long long)incise_haptic_lost(haptic), late,
		       100.0 * (double)late / (double)n, ages_ms[n / 2],
		       ages_ms[n * 99 / 100], ages_ms[n * 999 / 1000], ages_ms[n - 1],
		       (double)(last_ns - start_ns) * 1e-9);
	incise_haptic_close(haptic);
	free(ages_ms);
	return 0;
}
