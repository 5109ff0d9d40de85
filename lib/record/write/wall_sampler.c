// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Points of wall time once a second; see wall_sampler.h.
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/clock.h>
#include <incise/recorder.h>
#include "../../base/monotonic.h"
#include "../../rig/thread.h"
#include "wall_sampler.h"
#include "wall_sources.h"

#define PERIOD_NS INCISE_NS_PER_S
/* Taken 10 times a second at least; a disk that hangs holds up a poll for some seconds. */
#define WAITING 64
/* 2027-01-15 08:00 */
#define SIMULATED_S 1.8e9
#define CHRONY_PORT 323
/* The time that a program that was named has to answer once. */
#define ANSWER_NS (2 * INCISE_NS_PER_S)

enum { PTP, CHRONY, KERNEL, KINDS };

struct incise_wall_sampler {
	bool real;
	bool use[KINDS];
	struct incise_wall_peer ptp, chrony;
	/* A simulated clock: TAI at its time 0, s; its rate; the bound. */
	double tai_s, rate_ppm, bound_us;
	int64_t next_ns;
	struct incise_wall_follow follow;
	struct incise_wall_kernel kernel;

	pthread_t thread;
	bool running;
	pthread_mutex_t lock;
	pthread_cond_t changed;
	/* Under the lock. */
	bool stop;
	int n;
	struct incise_wall_result waiting[WAITING];
};

/* --- points --------------------------------------------------------------------------- */

/* Where there are too many, the newest takes the place of the one before, and its restart. */
static void put_wall_sampler(struct incise_wall_sampler *sampler,
			     const struct incise_wall_result *result)
{
	struct incise_wall_point *point;

	pthread_mutex_lock(&sampler->lock);
	if (sampler->n == WAITING)
		sampler->n--;
	else
		*sampler->waiting[sampler->n].point.restart = 0;
	point = &sampler->waiting[sampler->n].point;
	if (*point->restart && !*result->point.restart) {
		struct incise_wall_result kept = *result;

		memcpy(kept.point.restart, point->restart, sizeof(kept.point.restart));
		sampler->waiting[sampler->n++] = kept;
	} else {
		sampler->waiting[sampler->n++] = *result;
	}
	pthread_mutex_unlock(&sampler->lock);
}

static void sample(struct incise_wall_sampler *sampler)
{
	struct incise_wall_statement statements[INCISE_WALL_SOURCES];
	struct incise_wall_reading readings[INCISE_WALL_SOURCES];
	struct incise_wall_clocks clocks = {0};
	struct incise_wall_result result;
	/* In this order of preference; the kernel's are last. */
	struct incise_wall_statement *const ptp = &statements[0];
	struct incise_wall_statement *const chrony = &statements[1];
	const int n = INCISE_WALL_SOURCES;

	incise_wall_read_clocks(&clocks);
	incise_wall_kernel_read(&sampler->kernel, &clocks, &statements[2]);
	*ptp = *chrony = (struct incise_wall_statement){0};
	if (sampler->use[PTP])
		incise_wall_ptp_read(&sampler->ptp, &clocks, ptp);
	/* Last, as chronyd may be slewing the clock fast. */
	if (sampler->use[CHRONY])
		incise_wall_chrony_read(&sampler->chrony, &clocks, chrony);
	incise_wall_read_clocks(&clocks);
	for (int i = 0; i < n; i++) {
		readings[i] = statements[i].reading;
		/* The change of the rate within ms is nothing. */
		if (statements[i].tai_raw_ns)
			readings[i].tai_ns += clocks.raw_ns - statements[i].tai_raw_ns;
		else
			readings[i].tai_ns = clocks.real_ns +
					     readings[i].utc_offset_s * INCISE_NS_PER_S -
					     llrint(statements[i].offset_ns);
	}
	readings[2].good &= sampler->use[KERNEL];
	incise_wall_follow(&sampler->follow, &clocks, readings, n, &result);
	put_wall_sampler(sampler, &result);
}

/* The time of a simulated clock is true within its bound, by its own statement. */
static void simulate(struct incise_wall_sampler *sampler, int64_t now_ns)
{
	struct incise_wall_result result = {
		.point = {
			.t_ns = now_ns,
			.tai_ns = llrint(sampler->tai_s * 1e9) + now_ns +
				  llrint((double)now_ns * sampler->rate_ppm * 1e-6),
			.uncertainty_ns = sampler->bound_us * 1e3,
			.rate_ppb = sampler->rate_ppm * 1e3,
			.utc_offset_s = 37,
			.source = "simulated",
			.reference = "TAI",
			.leap = "assumed",
		}};

	put_wall_sampler(sampler, &result);
	sampler->next_ns = now_ns + PERIOD_NS;
}

static void *run_wall_sampler(void *argument)
{
	struct incise_wall_sampler *sampler = argument;
	bool last = false;

	while (!last) {
		struct timespec until;
		int rc = 0;

		clock_gettime(CLOCK_MONOTONIC, &until);
		until.tv_sec++;
		/* One more after the stop. */
		pthread_mutex_lock(&sampler->lock);
		last = sampler->stop;
		pthread_mutex_unlock(&sampler->lock);
		sample(sampler);
		pthread_mutex_lock(&sampler->lock);
		while (!sampler->stop && !rc)
			rc = pthread_cond_timedwait(&sampler->changed, &sampler->lock,
						    &until);
		pthread_mutex_unlock(&sampler->lock);
	}
	return NULL;
}

/* --- interface ------------------------------------------------------------------------ */

/* "sim", or "sim:TAI_S,PPM,BOUND_US" with any of them left out from the end. */
static bool read_simulated(struct incise_wall_sampler *sampler, const char *text)
{
	double *const to[] = {&sampler->tai_s, &sampler->rate_ppm, &sampler->bound_us};
	size_t i = 0;

	if (strncmp(text, "sim", 3) != 0 || (text[3] && text[3] != ':'))
		return false;
	text += strcmp(text, "sim:") ? 3 : 4;
	while (*text && i < 3) {
		char *end;

		*to[i] = strtod(text + 1, &end);
		if (end == text + 1 || !isfinite(*to[i++]) || (*end && *end != ','))
			return false;
		text = end;
	}
	return !*text && sampler->tai_s >= 0 && sampler->tai_s < 9e9 &&
	       fabs(sampler->rate_ppm) <= 1e4 && sampler->bound_us >= 0 &&
	       sampler->bound_us <= 1e9;
}

/* A number from 0 to @most behind a sign, or the end of the text. */
static bool read_number(const char *text, int most, int *value)
{
	char *end;
	long number;

	if (!*text)
		return true;
	number = strtol(text + 1, &end, 10);
	*value = (int)number;
	return end != text + 1 && !*end && number >= 0 && number <= most;
}

/* "auto"; "kernel"; "chrony", "chrony:PORT"; "ptp", "ptp:SOCKET", "ptp:SOCKET,DOMAIN" */
static bool read_real(struct incise_wall_sampler *sampler, const char *text)
{
	bool all = !strcmp(text, "auto");
	const char *comma;

	for (int i = 0; i < KINDS; i++)
		sampler->use[i] = all;
	if (all)
		return true;
	if (!strncmp(text, "chrony", 6)) {
		sampler->use[CHRONY] = true;
		return (!text[6] || text[6] == ':') &&
		       read_number(text + 6, 65535, &sampler->chrony.port) &&
		       sampler->chrony.port > 0;
	}
	if (!strncmp(text, "ptp", 3)) {
		sampler->use[PTP] = true;
		text += 3;
		comma = strchr(text, ',');
		if (!comma)
			comma = text + strlen(text);
		if (*text && (*text != ':' || comma == text + 1 ||
			      comma - text > (ptrdiff_t)sizeof(sampler->ptp.path)))
			return false;
		if (*text)
			snprintf(sampler->ptp.path, sizeof(sampler->ptp.path), "%.*s",
				 (int)(comma - text - 1), text + 1);
		return read_number(comma, 127, &sampler->ptp.domain);
	}
	sampler->use[KERNEL] = !strcmp(text, "kernel");
	return sampler->use[KERNEL];
}

static int read_source(struct incise_wall_sampler *sampler, const char *source,
		       bool *wanted, struct incise_error *err)
{
	bool simulated = source && !strncmp(source, "sim", 3);

	*wanted = sampler->real ? !source || strcmp(source, "none") != 0 : simulated;
	if (!source || !strcmp(source, "none"))
		return 0;
	if (sampler->real != simulated &&
	    (simulated ? read_simulated(sampler, source) : read_real(sampler, source)))
		return 0;
	return incise_error_set(
		err, EINVAL, "clock source '%s': %s", source,
		sampler->real == simulated
			? sampler->real
				  ? "is for a simulated clock, and this rig's clock is real; "
				    "use a rig sim:clock=simulated, or another source"
				  : "the clock of this rig is simulated and has no wall "
				    "time; use none or sim:TAI_S,PPM,BOUND_US"
		: sampler->real ? "no such source; use auto, ptp[:SOCKET[,DOMAIN]], "
				  "chrony[:PORT], kernel, none, or for a simulated clock "
				  "sim:TAI_S,PPM,BOUND_US"
				: "not sim:TAI_S,PPM,BOUND_US, with numbers");
}

/*
 * A program that was named is asked before anything is recorded, as its silence would be noticed
 * only when the recordings are joined. It may have been started just now.
 */
static int ask_named(struct incise_wall_sampler *sampler, const char *source,
		     struct incise_error *err)
{
	const int64_t until_ns = incise_monotonic_ns() + ANSWER_NS;
	struct incise_wall_statement statement = {0};
	struct incise_wall_clocks clocks = {0};
	bool ptp = sampler->use[PTP];

	for (;;) {
		incise_wall_read_clocks(&clocks);
		if (ptp)
			incise_wall_ptp_read(&sampler->ptp, &clocks, &statement);
		else
			incise_wall_chrony_read(&sampler->chrony, &clocks, &statement);
		if (statement.answered || incise_monotonic_ns() > until_ns)
			break;
		nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
	}
	if (!statement.answered)
		return incise_error_set(
			err, ENODATA, "clock source '%s': %s; start it, or use auto",
			source,
			ptp ? "ptp4l does not answer at its socket, or it is for root only"
			    : "chronyd does not answer");
	if (statement.of_card)
		return incise_error_set(
			err, ENODATA,
			"clock source '%s': ptp4l has the time of a network card, which "
			"is not read; give it to chronyd by 'refclock PHC' and use "
			"chrony, or run phc2sys and use kernel",
			source);
	return 0;
}

static int start_wall_sampler_thread(struct incise_wall_sampler *sampler)
{
	pthread_condattr_t attributes;
	int rc = -pthread_condattr_init(&attributes);

	if (rc)
		return rc;
	pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
	rc = -pthread_cond_init(&sampler->changed, &attributes);
	pthread_condattr_destroy(&attributes);
	if (rc)
		return rc;
	rc = incise_thread_start(&sampler->thread, run_wall_sampler, sampler, NULL);
	sampler->running = !rc;
	if (rc)
		pthread_cond_destroy(&sampler->changed);
	return rc;
}

static struct incise_wall_sampler *make(bool real)
{
	struct incise_wall_sampler *made = calloc(1, sizeof(*made));

	if (!made)
		return NULL;
	made->real = real;
	incise_wall_peer_init(&made->ptp);
	incise_wall_peer_init(&made->chrony);
	made->chrony.port = CHRONY_PORT;
	read_real(made, "auto");
	made->tai_s = SIMULATED_S;
	made->bound_us = 1;
	return made;
}

int incise_recorder_check_clock_source(const char *source, struct incise_error *err)
{
	/* The sampler is for the clock that the source is for. */
	struct incise_wall_sampler *made = make(strncmp(source, "sim", 3) != 0);
	bool wanted;
	int rc;

	if (!made)
		return incise_error_set(err, ENOMEM, "clock source: out of memory");
	rc = read_source(made, source, &wanted, err);
	free(made);
	return rc;
}

int incise_wall_sampler_new(struct incise_wall_sampler **sampler, const char *source,
			    bool real, struct incise_error *err)
{
	struct incise_wall_sampler *made = make(real);
	bool wanted = false;
	int rc;

	*sampler = NULL;
	if (!made)
		return incise_error_set(err, ENOMEM, "clock source: out of memory");
	rc = read_source(made, source, &wanted, err);
	if (!rc && real && made->use[PTP] + made->use[CHRONY] == 1)
		rc = ask_named(made, source, err);
	pthread_mutex_init(&made->lock, NULL);
	if (!rc && wanted && real) {
		rc = start_wall_sampler_thread(made);
		if (rc)
			incise_error_set(err, -rc, "clock source: no thread: %s",
					 strerror(-rc));
	}
	if (rc || !wanted)
		incise_wall_sampler_free(made);
	else
		*sampler = made;
	return rc;
}

int incise_wall_sampler_take(struct incise_wall_sampler *sampler, int64_t now_ns,
			     struct incise_wall_result *results, int max)
{
	int n;

	if (!sampler->real && now_ns >= sampler->next_ns)
		simulate(sampler, now_ns);
	pthread_mutex_lock(&sampler->lock);
	n = sampler->n < max ? sampler->n : max;
	memcpy(results, sampler->waiting, n * sizeof(*results));
	sampler->n -= n;
	memmove(sampler->waiting, sampler->waiting + n, sampler->n * sizeof(*results));
	pthread_mutex_unlock(&sampler->lock);
	return n;
}

void incise_wall_sampler_stop(struct incise_wall_sampler *sampler, int64_t now_ns)
{
	if (!sampler)
		return;
	if (!sampler->real && now_ns > sampler->next_ns - PERIOD_NS)
		simulate(sampler, now_ns);
	if (!sampler->running)
		return;
	pthread_mutex_lock(&sampler->lock);
	sampler->stop = true;
	pthread_cond_signal(&sampler->changed);
	pthread_mutex_unlock(&sampler->lock);
	pthread_join(sampler->thread, NULL);
	pthread_cond_destroy(&sampler->changed);
	sampler->running = false;
}

void incise_wall_sampler_free(struct incise_wall_sampler *sampler)
{
	if (!sampler)
		return;
	incise_wall_sampler_stop(sampler, sampler->next_ns - PERIOD_NS);
	incise_wall_peer_close(&sampler->ptp);
	incise_wall_peer_close(&sampler->chrony);
	pthread_mutex_destroy(&sampler->lock);
	free(sampler);
}
