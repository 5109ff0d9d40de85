// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tracker behind an OpenIGTLink server, "igtl:HOST:PORT:DEVICE": PLUS, 3D Slicer, or `incise
 * serve`. A thread receives and puts samples into a ring; incise_tracker_read() takes them from
 * there, which is real-time safe.
 *
 * When the connection breaks, or what comes is not OpenIGTLink, the thread connects again every
 * 250 ms for 10 s. Until then read() returns 0, and missing poses count as lost when others come.
 * After that, and after 10 s without any message, read() returns -ENODEV for good.
 */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/server_link.h"
#include "../../rig/thread.h"
#include "../../rig/tracker_feed.h"
#include "igtl_poses.h"

#define MS INT64_C(1000000)
#define PORT 18944
#define FIRST_MS 5000  /* for enough poses to know the rate */
#define LEARN_NS 5e8   /* of poses */
#define RATE_LEAST 1.0 /* of a tracker, Hz */
#define RATE_MOST 10000.0
#define RETRY_MS 250
#define GONE_MS 10000
#define CHUNK 65536

struct igtl_tracker {
	struct tracker_feed feed; /* first */
	struct igtl_poses poses;
	struct server_link link;
	char name[64];
	double rate_hz;
	pthread_t thread;
	bool runs;
	uint8_t bytes[CHUNK];
};

static struct igtl_tracker *igtl_tracker_of(const struct incise_tracker *tracker)
{
	return (struct igtl_tracker *)tracker;
}

/* --- connection --- */

/*
 * Receive for at most @ms. 1: something came; 0: nothing; -ECANCELED; -EPIPE (it was closed),
 * -EPROTO, or another errno of the connection.
 */
static int receive_igtl_tracker(struct igtl_tracker *t, int64_t ms)
{
	int rc = server_link_wait(&t->link, t->link.fd, POLLIN, ms);
	ssize_t n;

	if (rc <= 0)
		return rc;
	n = recv(t->link.fd, t->bytes, sizeof(t->bytes), 0);
	if (n < 0)
		return errno == EAGAIN || errno == EINTR ? 0 : -errno;
	if (!n)
		return -EPIPE;
	rc = igtl_poses_put(&t->poses, t->bytes, (size_t)n, incise_monotonic_ns());
	return rc ? rc : 1;
}

/* --- thread --- */

/* Connect again. False: it did not come back, or is being closed. */
static bool recover(struct igtl_tracker *t)
{
	int64_t until_ns = incise_monotonic_ns() + GONE_MS * MS;

	server_link_close(&t->link);
	do {
		/* -1 is passed over by poll(). */
		if (server_link_wait(&t->link, -1, 0, RETRY_MS) < 0)
			return false;
		if (!server_link_connect(&t->link))
			return !igtl_poses_reconnected(&t->poses);
	} while (incise_monotonic_ns() < until_ns);
	return false;
}

static void end_igtl_tracker(struct igtl_tracker *t, const char *what)
{
	tracker_feed_end(&t->feed,
			 "%s %s; start its server again, check the network, and start "
			 "again",
			 t->name, what);
}

static void *run_igtl_tracker(void *argument)
{
	struct igtl_tracker *t = argument;
	int64_t since_ns = incise_monotonic_ns();
	uint64_t messages = t->poses.messages;
	int rc = 0;

	while (rc != -ECANCELED) {
		int64_t now_ns;

		rc = receive_igtl_tracker(t, RETRY_MS);
		now_ns = incise_monotonic_ns();
		if (messages != t->poses.messages)
			since_ns = now_ns;
		messages = t->poses.messages;
		/* A server that answers each connection with the same nonsense, too. */
		if (now_ns - since_ns > GONE_MS * MS) {
			end_igtl_tracker(t, "sent no message for 10 s");
			break;
		}
		if (rc >= 0 || rc == -ECANCELED)
			continue;
		incise_thread_hurry(false);
		if (!recover(t)) {
			end_igtl_tracker(t, "disconnected and was not back after 10 s");
			break;
		}
		incise_thread_hurry(true);
	}
	return NULL;
}

/* --- struct incise_tracker_ops --- */

static void tracker_info(const struct incise_tracker *tracker,
			 struct incise_tracker_info *info)
{
	*info = (struct incise_tracker_info){
		.rate_hz = igtl_tracker_of(tracker)->rate_hz,
		.stations = 1,
		.scalpel_station = 1,
		.external_sync = true, /* the sender decides when */
		.network = true,
		.lost_unsure = atomic_load(&igtl_tracker_of(tracker)->poses.unsure),
	};
	snprintf(info->name, sizeof(info->name), "%s", igtl_tracker_of(tracker)->name);
}

static uint64_t tracker_lost(const struct incise_tracker *tracker)
{
	return atomic_load_explicit(&igtl_tracker_of(tracker)->poses.lost,
				    memory_order_relaxed);
}

static void tracker_close(struct incise_tracker *tracker)
{
	struct igtl_tracker *t = igtl_tracker_of(tracker);
	uint64_t one = 1;

	if (t->runs) {
		while (write(t->link.stop, &one, sizeof(one)) < 0 && errno == EINTR)
			;
		pthread_join(t->thread, NULL);
	}
	server_link_close(&t->link);
	if (t->link.stop >= 0)
		close(t->link.stop);
	igtl_poses_free(&t->poses);
	free(t);
}

static const struct incise_tracker_ops ops = {
	.read = tracker_feed_read,
	.info = tracker_info,
	.lost = tracker_lost,
	.close = tracker_close,
	.cause = tracker_feed_cause,
};

/* --- opening --- */

/* "HOST", "HOST:PORT", "HOST:PORT:DEVICE"; an address of IPv6 in brackets. */
static int parse_igtl_tracker(struct igtl_tracker *t, const char *arguments,
			      const char **device, const char *where,
			      struct incise_error *err)
{
	const char *rest = "";
	int rc = server_link_parse(&t->link, arguments, PORT, &rest);

	*device = *rest ? rest + 1 : "";
	if (rc == -ERANGE)
		return incise_error_set(
			err, EINVAL,
			"%s: \"%.80s\": the port is not a number from 1 to "
			"65535; correct it",
			where, arguments);
	if (rc || strlen(*device) > IGTL_HEADER_NAME_SIZE || (*rest && !**device))
		return incise_error_set(
			err, EINVAL,
			"%s: \"%.80s\": expected igtl:HOST:PORT:DEVICE with a name of at most "
			"%d letters, such as igtl:localhost:18944:StylusToTracker; correct it",
			where, arguments, IGTL_HEADER_NAME_SIZE);
	return 0;
}

static int no_poses(const struct igtl_tracker *t, const char *where,
		    struct incise_error *err)
{
	const struct igtl_poses *poses = &t->poses;
	char list[160] = "";

	for (int i = 0; i < poses->n_names; i++)
		snprintf(list + strlen(list), sizeof(list) - strlen(list), "%s%s",
			 i ? ", " : "",
			 *poses->names[i] ? poses->names[i] : "one without a name");
	if (!poses->messages && poses->damaged)
		return incise_error_set(
			err, EBADMSG,
			"%s: the messages of the server at %.100s port %s have a wrong "
			"checksum (CRC-64); use another version of it",
			where, t->link.host, t->link.port);
	if (!poses->messages)
		return incise_error_set(
			err, EIO,
			"%s: the server at %.100s port %s sends no message within "
			"%d s; start its transmission",
			where, t->link.host, t->link.port, FIRST_MS / 1000);
	if (!*poses->device && poses->n_names > 1)
		return incise_error_set(
			err, EINVAL,
			"%s: the server at %.100s port %s sends several poses: %s; "
			"name one, as in igtl:HOST:PORT:DEVICE",
			where, t->link.host, t->link.port, list);
	if (poses->n >= 2)
		return incise_error_set(
			err, EIO,
			"%s: \"%s\" of the server at %.100s port %s sends less "
			"than %g or more than %g poses a second; change its rate",
			where, poses->names[0], t->link.host, t->link.port, RATE_LEAST,
			RATE_MOST);
	return incise_error_set(
		err, EIO,
		"%s: the server at %.100s port %s sends no pose \"%s\" within %d "
		"s; poses come of: %s",
		where, t->link.host, t->link.port, poses->device, FIRST_MS / 1000,
		*list ? list : "no device");
}

static int two_senders(const struct igtl_tracker *t, const char *where,
		       struct incise_error *err)
{
	return incise_error_set(
		err, EINVAL,
		"%s: the poses \"%s\" of the server at %.100s port %s go to and fro "
		"between two places, as of two senders; give each its own name",
		where, t->poses.device, t->link.host, t->link.port);
}

/* Receive until the rate is known. */
static int learn_igtl_tracker(struct igtl_tracker *t, const char *where,
			      struct incise_error *err)
{
	int64_t until_ns = incise_monotonic_ns() + FIRST_MS * MS, now_ns;
	double hz;
	int rc = 0;

	while (rc >= 0 && (now_ns = incise_monotonic_ns()) < until_ns) {
		rc = receive_igtl_tracker(t, (until_ns - now_ns) / MS + 1);
		hz = igtl_poses_hz(&t->poses);
		if (hz >= RATE_LEAST && hz <= RATE_MOST &&
		    (double)(t->poses.last_ns - t->poses.first_ns) >= LEARN_NS) {
			t->rate_hz = hz;
			return igtl_poses_alternate(&t->poses)
				       ? two_senders(t, where, err)
				       : 0;
		}
	}
	if (rc == -EPROTO)
		return incise_error_set(
			err, EPROTO,
			"%s: %.100s port %s does not send OpenIGTLink; correct host "
			"and port",
			where, t->link.host, t->link.port);
	if (rc < 0)
		return incise_error_set(
			err, -rc,
			"%s: %.100s port %s: the server closed the connection; see "
			"its messages",
			where, t->link.host, t->link.port);
	return no_poses(t, where, err);
}

static int begin_igtl_tracker(struct igtl_tracker *t,
			      const struct incise_backend_request *request,
			      struct incise_error *err)
{
	static const struct incise_tracker_setup usual = {.repeat_ms = 100};
	const char *device, *where = request->where;
	bool real_time;
	int rc = parse_igtl_tracker(t, request->arguments, &device, where, err);

	if (rc)
		return rc;
	t->link.stop = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	rc = t->link.stop < 0
		     ? -errno
		     : igtl_poses_init(&t->poses,
				       request->tracker ? request->tracker : &usual,
				       device);
	if (rc)
		return incise_error_set(err, -rc, "%s: %s; end other programs", where,
					strerror(-rc));
	rc = server_link_find(&t->link, "OpenIGTLink", where, err);
	rc = rc ? rc : learn_igtl_tracker(t, where, err);
	if (rc)
		return rc;
	igtl_poses_start(&t->poses, t->rate_hz);
	if (t->poses.coarse)
		snprintf(t->name, sizeof(t->name), "OpenIGTLink %.20s, times of arrival",
			 t->poses.device);
	else
		snprintf(t->name, sizeof(t->name), "OpenIGTLink %s at %.24s",
			 t->poses.device, t->link.host);
	rc = incise_thread_start(&t->thread, run_igtl_tracker, t, &real_time);
	t->runs = !rc;
	return rc ? incise_error_set(err, -rc,
				     "%s: no thread to receive it; end other programs",
				     where)
		  : 0;
}

static void *tracker_open(const struct incise_backend_request *request,
			  struct incise_error *err)
{
	struct igtl_tracker *t = incise_backend_alloc(sizeof(*t), request->where, err);
	int rc;

	if (!t)
		return NULL;
	t->feed.tracker.ops = &ops;
	t->feed.ring = &t->poses.ring;
	t->link.fd = t->link.stop = -1;
	rc = begin_igtl_tracker(t, request, err);
	if (!rc)
		return &t->feed.tracker;
	tracker_close(&t->feed.tracker);
	errno = -rc;
	return NULL;
}

const struct incise_backend incise_tracker_igtl = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "tracker",
	.name = "igtl",
	.open = tracker_open,
};

INCISE_MODULE(incise_tracker_igtl);
