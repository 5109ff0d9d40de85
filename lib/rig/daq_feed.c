// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The way of force samples from a card's thread to their reader; see daq_feed.h.
 */
#include <errno.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/eventfd.h>
#include <unistd.h>
#include "thread.h"
#include "daq_feed.h"

#define RATE_MOST_HZ 100000

static const struct daq_feed *daq_feed_of(const struct incise_force *force)
{
	return (const struct daq_feed *)force;
}

int daq_feed_setup(const struct incise_backend_request *request,
		   struct incise_force_setup *setup, struct incise_error *err)
{
	static const struct incise_force_setup usual = {.rate_hz = 10000};

	*setup = request->force ? *request->force : usual;
	setup->trigger[sizeof(setup->trigger) - 1] = '\0';
	if (setup->rate_hz >= 1 && setup->rate_hz <= RATE_MOST_HZ && setup->channel >= 0)
		return 0;
	return incise_error_set(err, EINVAL,
				"%s: channel %d at %.9g Hz: expected 0 or more, and 1 to "
				"%d Hz; correct force_setup",
				request->where, setup->channel, setup->rate_hz,
				RATE_MOST_HZ);
}

int daq_feed_init(struct daq_feed *feed)
{
	double capacity = feed->info.rate_hz * DAQ_FEED_CAPACITY_S;

	feed->stop = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	if (feed->stop < 0)
		return -errno;
	/* A slow card needs capacity for a reader's pause, too. */
	return incise_ring_init(&feed->ring, sizeof(struct incise_force_sample),
				capacity > 1024 ? (size_t)capacity : 1024);
}

void daq_feed_free(struct daq_feed *feed)
{
	incise_ring_free(&feed->ring);
	if (feed->stop >= 0)
		close(feed->stop);
}

int daq_feed_start(struct daq_feed *feed, void *(*run)(void *), void *card)
{
	int rc = incise_thread_start(&feed->thread, run, card, &feed->real_time);

	feed->runs = !rc;
	return rc;
}

void daq_feed_stop(struct daq_feed *feed)
{
	uint64_t one = 1;

	if (!feed->runs)
		return;
	/* An eventfd at 0 takes a 1. */
	while (write(feed->stop, &one, sizeof(one)) < 0 && errno == EINTR)
		;
	pthread_join(feed->thread, NULL);
	feed->runs = false;
}

enum daq_wait daq_feed_wait(struct daq_feed *feed, int fd, int ms)
{
	struct pollfd on[2] = {{.fd = feed->stop, .events = POLLIN},
			       {.fd = fd, .events = POLLIN}};
	int n = poll(on, 2, ms);

	if (n > 0 && on[0].revents)
		return DAQ_STOP;
	/* An error of @fd is ready too: reading shows which. */
	return n > 0 ? DAQ_READY : DAQ_QUIET;
}

static void count_daq_feed(_Atomic uint64_t *counter, uint64_t n)
{
	atomic_fetch_add_explicit(counter, n, memory_order_relaxed);
}

void daq_feed_put(struct daq_feed *feed, int64_t t_ns, int32_t code)
{
	struct incise_force_sample sample = {t_ns, feed->seq++, code};

	if (code <= 0 || code >= (int32_t)((UINT32_C(1) << feed->info.bits) - 1))
		count_daq_feed(&feed->clipped, 1);
	if (incise_ring_put(&feed->ring, &sample)) {
		feed->full = false;
		return;
	}
	count_daq_feed(&feed->lost, 1);
	if (!feed->full)
		count_daq_feed(&feed->overflows, 1);
	feed->full = true;
}

void daq_feed_lose(struct daq_feed *feed, uint64_t n)
{
	if (!n)
		return;
	feed->seq += n;
	count_daq_feed(&feed->lost, n);
	count_daq_feed(&feed->overflows, 1);
}

void daq_feed_pace(struct daq_feed *feed, struct incise_pace *pace, int64_t t_ns,
		   int64_t arrival_ns)
{
	daq_feed_lose(feed, incise_pace_add(pace, t_ns, arrival_ns));
	atomic_store_explicit(&feed->unsure, pace->unsure, memory_order_relaxed);
}

void daq_feed_end(struct daq_feed *feed, int error, const char *what)
{
	if (error == -ENODEV)
		incise_error_set(&feed->cause, ENODEV,
				 "%s was unplugged; plug it in and start again",
				 feed->info.name);
	else if (error)
		incise_error_set(&feed->cause, -error, "%s: %s", feed->info.name, what);
	atomic_store_explicit(&feed->error, error, memory_order_release);
}

int daq_feed_read(struct incise_force *force, struct incise_force_sample *samples, int n)
{
	struct daq_feed *feed = (struct daq_feed *)force;
	/* Before the ring: samples put in ahead of the end are read first. */
	int error = atomic_load_explicit(&feed->error, memory_order_acquire);
	int taken = incise_ring_take(&feed->ring, samples, n);

	return taken ? taken : error;
}

void daq_feed_info(const struct incise_force *force, struct incise_force_info *info)
{
	const struct daq_feed *feed = daq_feed_of(force);

	*info = feed->info;
	info->clipped = atomic_load_explicit(&feed->clipped, memory_order_relaxed);
	info->overflows = atomic_load_explicit(&feed->overflows, memory_order_relaxed);
	info->lost_unsure = atomic_load_explicit(&feed->unsure, memory_order_relaxed);
}

uint64_t daq_feed_lost(const struct incise_force *force)
{
	return atomic_load_explicit(&daq_feed_of(force)->lost, memory_order_relaxed);
}

int daq_feed_cause(struct incise_force *force, char *text, size_t size)
{
	const struct daq_feed *feed = daq_feed_of(force);
	int error = atomic_load_explicit(&feed->error, memory_order_acquire);

	return snprintf(text, size, "%s", error ? feed->cause.text : "");
}
