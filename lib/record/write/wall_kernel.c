// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Wall time by the kernel's clocks and its state of synchronisation; see wall_sources.h.
 *
 *     CLOCK_MONOTONIC ─┬── bracket ──┬─
 *                      └ REALTIME, RAW, BOOTTIME
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/timex.h>
#include <time.h>
#include <incise/clock.h>
#include "../../base/monotonic.h"
#include "wall_sources.h"

#define TRIES 5
/* A list of less than 100 leap seconds, with its comments. */
#define LIST_MAX 65536
/* From 1900, the epoch of the list, to 1970. */
#define NTP_EPOCH_S 2208988800LL
/* Since 2017, with no other announced until the end of 2026. */
#define ASSUMED_S 37
#define UTC_OFFSET_MAX_S 1000
/*
 * The clock of a client that states no error of its own (systemd-timesyncd sets it to 0): the
 * usual limit of SNTP over a network.
 */
#define UNSTATED_NS 100e6

static const char list_path[] = "/usr/share/zoneinfo/leap-seconds.list";

void incise_wall_read_clocks(struct incise_wall_clocks *clocks)
{
	clocks->half_ns = INT64_MAX;
	for (int i = 0; i < TRIES; i++) {
		int64_t from_ns = incise_monotonic_ns();
		int64_t real_ns = incise_read_clock_ns(CLOCK_REALTIME);
		int64_t raw_ns = incise_read_clock_ns(CLOCK_MONOTONIC_RAW);
		int64_t boot_ns = incise_read_clock_ns(CLOCK_BOOTTIME);
		int64_t half_ns = (incise_monotonic_ns() - from_ns + 1) / 2;

		if (half_ns >= clocks->half_ns)
			continue;
		clocks->half_ns = half_ns;
		clocks->mono_ns = from_ns + half_ns;
		clocks->real_ns = real_ns;
		clocks->raw_ns = raw_ns;
		clocks->boot_ns = boot_ns;
	}
}

/* --- leap seconds ---------------------------------------------------------------------- */

bool incise_leap_list_read(struct incise_leap_list *list, char *text)
{
	char *save, *line;

	*list = (struct incise_leap_list){0};
	for (line = strtok_r(text, "\n", &save); line;
	     line = strtok_r(NULL, "\n", &save)) {
		long long from_s, offset_s;
		int end = 0;

		if (sscanf(line, "#@ %lld", &from_s) == 1)
			list->expires_s = from_s - NTP_EPOCH_S;
		if (*line == '#' ||
		    sscanf(line, "%lld %lld%n", &from_s, &offset_s, &end) < 2)
			continue;
		if (list->n == sizeof(list->leaps) / sizeof(*list->leaps) || from_s < 0 ||
		    from_s > UINT32_MAX + NTP_EPOCH_S || offset_s < 1 ||
		    offset_s > UTC_OFFSET_MAX_S ||
		    (list->n && from_s - NTP_EPOCH_S <= list->leaps[list->n - 1].from_s))
			return false;
		list->leaps[list->n].from_s = from_s - NTP_EPOCH_S;
		list->leaps[list->n++].offset_s = (int)offset_s;
	}
	return list->n > 0 && list->expires_s > 0;
}

static bool load_list(struct incise_leap_list *list)
{
	FILE *file = fopen(list_path, "re");
	char *text = file ? malloc(LIST_MAX + 1) : NULL;
	bool good = false;

	if (text) {
		text[fread(text, 1, LIST_MAX, file)] = 0;
		good = incise_leap_list_read(list, text);
	}
	free(text);
	if (file)
		fclose(file);
	return good;
}

/* TAI less UTC without the kernel's number, which is 0 until a program sets it. */
static void find_offset(struct incise_wall_clocks *clocks)
{
	int64_t now_s = clocks->real_ns / INCISE_NS_PER_S;
	struct incise_leap_list list;

	clocks->utc_offset_s = ASSUMED_S;
	snprintf(clocks->leap, sizeof(clocks->leap), "assumed");
	if (!load_list(&list))
		return;
	for (int i = 0; i < list.n && list.leaps[i].from_s <= now_s; i++)
		clocks->utc_offset_s = list.leaps[i].offset_s;
	snprintf(clocks->leap, sizeof(clocks->leap), "%s",
		 now_s < list.expires_s ? "list" : "expired list");
}

/* --- state ------------------------------------------------------------------------------ */

void incise_wall_kernel_read(struct incise_wall_kernel *kernel,
			     struct incise_wall_clocks *clocks,
			     struct incise_wall_statement *statements)
{
	struct incise_wall_reading *synced = &statements[0].reading,
				   *plain = &statements[1].reading;
	struct timex state = {0};
	int rc = adjtimex(&state);
	double error_ns = (double)state.maxerror * 1e3;

	if (rc >= 0 && state.tai > 0 && state.tai <= UTC_OFFSET_MAX_S) {
		clocks->utc_offset_s = state.tai;
		snprintf(clocks->leap, sizeof(clocks->leap), "kernel");
	} else {
		find_offset(clocks);
	}
	*statements = (struct incise_wall_statement){
		.reading =
			{
				.good = rc >= 0 && rc != TIME_ERROR &&
					!(state.status & STA_UNSYNC) &&
					state.maxerror >= 0,
				.source = "kernel",
				.reference = "TAI",
				/* The limit of its own corrections, scaled by 2^16. */
				.rate_uncertainty_ppb =
					(double)state.tolerance / 65536 * 1e3,
			},
	};
	statements[1] = (struct incise_wall_statement){
		.reading = {.good = true,
			    .source = "plain",
			    .reference = "TAI",
			    .bound_ns = INFINITY},
	};
	/* It grows until the program that sets the clock has measured again. */
	if (error_ns < kernel->last_ns)
		kernel->updated++;
	kernel->last_ns = error_ns;
	synced->updated = kernel->updated;
	/* ptp4l and phc2sys set the first to 0 and leave the second, at 16 s. */
	synced->bound_ns = error_ns + (state.esterror > 0 ? (double)state.esterror * 1e3
							  : UNSTATED_NS);
	synced->utc_offset_s = plain->utc_offset_s = clocks->utc_offset_s;
	memcpy(synced->leap, clocks->leap, sizeof(synced->leap));
	memcpy(plain->leap, clocks->leap, sizeof(plain->leap));
}
