// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A tracker through the backend "usb", as the module that rig.conf would load:
 *
 *   tracker_usb DEVICE SECONDS          "0f44:0002": how many came, and how they were apart
 *   tracker_usb --refuse DEVICE TEXT    it is refused, and the line has TEXT in it
 *   tracker_usb --list                  what is attached
 *   tracker_usb --replug DEVICE A B     bound away by the script: A is run, B 2 s later
 *
 * Prints "ok …" and "not ok …".
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <incise/backend.h>
#include "../../clock.h"
#include "../../../lib/rig/backends.h"
#include "../tap.h"

#define MS INT64_C(1000000)

static const struct incise_tracker_setup setup = {
	.n_stations = 1, .stations = {1}, .hemisphere = {1, 0, 0}};

struct seen {
	uint64_t n, doubled, gaps, next;
	int64_t first_ns, last_ns, least_ns, most_ns;
};

static void rest(void)
{
	nanosleep(&(struct timespec){.tv_nsec = 5 * MS}, NULL);
}

static int take(struct incise_tracker *tracker, struct seen *s)
{
	struct incise_tracker_sample samples[64];
	int n = incise_tracker_read(tracker, samples, 64);

	for (int i = 0; i < n; i++) {
		int64_t apart = samples[i].t_ns - s->last_ns;

		if (!s->n) {
			s->first_ns = samples[i].t_ns;
			s->next = samples[i].seq;
			s->least_ns = INT64_MAX;
		} else {
			s->least_ns = apart < s->least_ns ? apart : s->least_ns;
			s->most_ns = apart > s->most_ns ? apart : s->most_ns;
		}
		s->doubled += samples[i].seq < s->next;
		s->gaps += samples[i].seq - s->next;
		s->next = samples[i].seq + 1;
		s->last_ns = samples[i].t_ns;
		s->n++;
	}
	return n;
}

/* 0 or -ENODEV. */
static int take_for(struct incise_tracker *tracker, struct seen *s, double seconds)
{
	int64_t end_ns = now_ns() + (int64_t)(seconds * 1e9);

	while (now_ns() < end_ns) {
		int n = take(tracker, s);

		if (n < 0)
			return n;
		rest();
	}
	return 0;
}

static struct incise_tracker *open_it(const char *device, struct incise_error *err)
{
	static struct incise_loaded loaded;
	const struct incise_backend_request request = {
		.arguments = device, .where = "rig.conf:1: tracker", .tracker = &setup};

	if (incise_backend_find(&loaded, "tracker", "usb", "rig.conf:1: tracker", err))
		return NULL;
	return loaded.backend->open(&request, err);
}

static int list(void *context, const struct incise_scan_device *device)
{
	(void)context;
	printf("%s %s: %s\n", device->usable ? "ready" : "waits", device->device,
	       device->what);
	return 0;
}

static int watch(const char *device, double seconds, const char *away, const char *back)
{
	struct incise_error err = {0};
	struct incise_tracker *tracker = open_it(device, &err);
	struct incise_tracker_info info;
	struct seen s = {0};
	const char *profile = getenv("INCISE_VM_PROFILE");
	bool virtual_time = profile && !strcmp(profile, "deterministic");
	uint64_t lost, before_lost;
	int rc;

	if (!tracker) {
		printf("not ok it opens\n# %s\n", err.text);
		return 1;
	}
	incise_tracker_info(tracker, &info);
	printf("ok it opens: %s, %.0f Hz\n", info.name, info.rate_hz);
	/* While its thread starts some wait, and come all at once. */
	rc = take_for(tracker, &s, 0.3);
	s = (struct seen){0};
	before_lost = incise_tracker_lost(tracker);
	if (!rc)
		rc = take_for(tracker, &s, seconds);
	lost = incise_tracker_lost(tracker) - before_lost;
	printf("# %llu records in %.3f s, %llu lost, %.3f to %.3f ms apart\n",
	       (unsigned long long)s.n, (double)(s.last_ns - s.first_ns) * 1e-9,
	       (unsigned long long)lost, (double)s.least_ns * 1e-6,
	       (double)s.most_ns * 1e-6);
	printf("%sok %s\n", rc || !s.n || s.doubled || s.gaps != lost ? "not " : "",
	       "every record is there once or counted");
	/* On two processors in the host's time pauses of 0.2 s are usual. */
	if (!away && virtual_time)
		printf("%sok 120 records a second, none lost\n",
		       lost || (double)s.n < 119 * seconds ||
				       (double)s.n > 121 * seconds + 1
			       ? "not "
			       : "");
	if (away) {
		uint64_t before = s.n;
		int64_t end_ns = now_ns() + 20000 * MS;

		if (system(away))
			printf("not ok %s\n", away);
		rc = take_for(tracker, &s, 2);
		printf("%sok unplugged: nothing comes, and it is no error yet\n",
		       rc || s.n > before + 60 ? "not " : "");
		if (system(back))
			printf("not ok %s\n", back);
		before = s.n;
		while (!rc && s.n < before + 240 && now_ns() < end_ns)
			rc = take_for(tracker, &s, 0.1);
		lost = incise_tracker_lost(tracker) - before_lost;
		printf("# %llu lost while it was away\n", (unsigned long long)lost);
		printf("%sok plugged in again it goes on, and the gap is counted\n",
		       rc || s.n < before + 240 || lost < 200 || s.gaps != lost ||
				       s.doubled
			       ? "not "
			       : "");
	}
	tracker->ops->close(tracker);
	return 0;
}

int main(int argc, char **argv)
{
	struct incise_error err = {0};

	/* A page that is fetched through 9p takes the guest's time. */
	mlockall(MCL_CURRENT | MCL_FUTURE);
	if (argc == 2 && !strcmp(argv[1], "--list")) {
		if (!incise_scan("tracker", "usb:", list, NULL, &err))
			return 0;
		printf("%s\n", err.text);
		return 1;
	}
	if (argc == 4 && !strcmp(argv[1], "--refuse")) {
		if (!open_it(argv[2], &err) && strstr(err.text, argv[3]))
			return 0;
		printf("%s\n", err.text);
		return 1;
	}
	if (argc == 5 && !strcmp(argv[1], "--replug"))
		return watch(argv[2], 2, argv[3], argv[4]);
	if (argc == 3)
		return watch(argv[1], atof(argv[2]), NULL, NULL);
	return 2;
}
