// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Wall time by chronyd and ptp4l; see wall_sources.h. Both are asked by datagrams, each with a
 * limit of time.
 *
 *     ptp4l    (RAW, TAI) of each sync ●  ●  ●  ●      a line through the last ones, as a single
 *                                    ╱ ── ── ── now    offset has the noise of its timestamps
 */
#include <arpa/inet.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <incise/clock.h>
#include "../../base/monotonic.h"
#include "wall_sources.h"

#define PATIENCE_NS 50000000LL /* of one request; both run on this computer */
#define PORTS_NS 2000000LL     /* between the answers of two ports */
/* A sync is a second apart or less; without one for this time the master is lost. */
#define SYNC_AGE_NS (5 * INCISE_NS_PER_S)
/* Further from CLOCK_REALTIME it is the time of another clock, a hardware one. */
#define SAME_CLOCK_NS (5 * INCISE_NS_PER_S)
/* Rate of a crystal until syncs have shown it, and its change within the line. */
#define CRYSTAL_PPB 200e3
#define WANDER_PPB 100.0
#define STEP_LEAST_NS 2000
#define SUSPEND_LEAST_NS 1000000
/* The grandmaster itself: its clock is the reference. */
#define OWN_BOUND_NS 1000.0
/* chronyd slews by no more. */
#define SLEW_MAX 0.1

/* --- sockets ---------------------------------------------------------------------------- */

void incise_wall_peer_init(struct incise_wall_peer *peer)
{
	*peer = (struct incise_wall_peer){.fd = -1, .patience_ns = PATIENCE_NS};
}

void incise_wall_peer_close(struct incise_wall_peer *peer)
{
	if (peer->fd >= 0)
		close(peer->fd);
	peer->fd = -1;
}

static int open_chrony(int port)
{
	struct sockaddr_in to = {
		.sin_family = AF_INET,
		.sin_port = htons((uint16_t)port),
		.sin_addr.s_addr = htonl(INADDR_LOOPBACK),
	};
	int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);

	/* Connected: answers of others are not received. */
	if (fd >= 0 && connect(fd, (struct sockaddr *)&to, sizeof(to))) {
		close(fd);
		fd = -1;
	}
	return fd;
}

static int open_ptp(const char *path)
{
	struct sockaddr_un own = {.sun_family = AF_UNIX}, to = {.sun_family = AF_UNIX};
	int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);

	snprintf(to.sun_path, sizeof(to.sun_path), "%s", path);
	/* An address of its own, for the answer, without a file. */
	if (fd >= 0 && (bind(fd, (struct sockaddr *)&own, sizeof(sa_family_t)) ||
			connect(fd, (struct sockaddr *)&to, sizeof(to)))) {
		close(fd);
		fd = -1;
	}
	return fd;
}

/* Wait for a datagram until @until_ns. Returns its bytes, or -1. */
static ssize_t receive_wall_peers(int fd, int64_t until_ns, uint8_t *bytes, size_t size)
{
	struct pollfd wait = {.fd = fd, .events = POLLIN};
	int64_t left_ns = until_ns - incise_monotonic_ns();
	struct timespec left = {left_ns / INCISE_NS_PER_S, left_ns % INCISE_NS_PER_S};

	if (left_ns <= 0 || ppoll(&wait, 1, &left, NULL) != 1)
		return -1;
	return recv(fd, bytes, size, 0);
}

/* Answers to earlier requests are of no use. */
static void drain(int fd)
{
	uint8_t bytes[16];

	for (int i = 0; i < 1000 && recv(fd, bytes, sizeof(bytes), 0) >= 0; i++)
		;
}

/* --- chronyd --------------------------------------------------------------------------- */

void incise_wall_chrony_read(struct incise_wall_peer *peer,
			     const struct incise_wall_clocks *clocks,
			     struct incise_wall_statement *statement)
{
	struct incise_wall_reading *reading = &statement->reading;
	struct incise_chrony_tracking tracking;
	uint8_t request[INCISE_CHRONY_BYTES], reply[512];
	int64_t asked_ns = incise_monotonic_ns(), until_ns = asked_ns + peer->patience_ns;
	bool answered = false;
	ssize_t n;

	*statement = (struct incise_wall_statement){
		.reading = {.source = "chrony",
			    .reference = "TAI",
			    .utc_offset_s = clocks->utc_offset_s,
			    .updated = peer->updated}};
	memcpy(reading->leap, clocks->leap, sizeof(reading->leap));
	if (peer->fd < 0)
		peer->fd = open_chrony(peer->port);
	if (peer->fd < 0)
		return;
	drain(peer->fd);
	incise_chrony_request(request, ++peer->sequence);
	n = send(peer->fd, request, sizeof(request), 0) == sizeof(request)
		    ? receive_wall_peers(peer->fd, until_ns, reply, sizeof(reply))
		    : -1;
	while (n >= 0 && !answered) {
		answered =
			incise_chrony_read(&tracking, reply, (size_t)n, peer->sequence);
		if (!answered)
			n = receive_wall_peers(peer->fd, until_ns, reply, sizeof(reply));
	}
	if (!answered)
		return;
	statement->answered = true;
	reading->good = tracking.synchronised;
	statement->offset_ns = -tracking.correction_s * 1e9;
	/* The limit that NTP defines, and how far a slew went since. */
	reading->bound_ns = (tracking.delay_s / 2 + tracking.dispersion_s) * 1e9 +
			    fmin(fabs(statement->offset_ns),
				 SLEW_MAX * (double)(incise_monotonic_ns() - asked_ns));
	reading->rate_uncertainty_ppb =
		(tracking.skew_ppm + fabs(tracking.rate_ppm)) * 1e3;
	reading->updated = peer->updated = tracking.ref_ns;
}

/* --- ptp4l ------------------------------------------------------------------------------ */

static bool ask(struct incise_wall_peer *peer, enum incise_ptp_id id,
		struct incise_ptp_state *state)
{
	uint8_t request[INCISE_PTP_REQUEST_BYTES], reply[1500];
	int64_t until_ns = incise_monotonic_ns() + peer->patience_ns;
	uint16_t sequence = (uint16_t)++peer->sequence;
	bool any = false;
	ssize_t n;

	incise_ptp_request(request, id, (uint8_t)peer->domain, sequence);
	if (send(peer->fd, request, sizeof(request), 0) != sizeof(request))
		return false;
	/* Each port answers for itself; the others answer once. */
	while ((!any || id == INCISE_PTP_PORT_DATA_SET ||
		id == INCISE_PTP_PORT_PROPERTIES_NP) &&
	       (n = receive_wall_peers(peer->fd,
				       any ? incise_monotonic_ns() + PORTS_NS : until_ns,
				       reply, sizeof(reply))) >= 0 &&
	       incise_monotonic_ns() < until_ns)
		any |= incise_ptp_read(state, reply, (size_t)n, (uint8_t)peer->domain,
				       sequence);
	return any;
}

static bool ask_all(struct incise_wall_peer *peer, struct incise_ptp_state *state)
{
	static const char *const paths[] = {"/run/ptp/ptp4lro", "/run/ptp4lro",
					    "/run/ptp/ptp4l", "/run/ptp4l"};

	for (size_t i = 0; peer->fd < 0 && !*peer->path && i < 4; i++)
		peer->fd = open_ptp(paths[i]);
	if (peer->fd < 0 && *peer->path)
		peer->fd = open_ptp(peer->path);
	if (peer->fd < 0)
		return false;
	drain(peer->fd);
	if (ask(peer, INCISE_PTP_TIME_STATUS_NP, state) &&
	    ask(peer, INCISE_PTP_CURRENT_DATA_SET, state) &&
	    ask(peer, INCISE_PTP_TIME_PROPERTIES, state) &&
	    ask(peer, INCISE_PTP_PORT_DATA_SET, state) &&
	    ask(peer, INCISE_PTP_PORT_PROPERTIES_NP, state))
		return true;
	/* It may have been started anew, with another socket of that name. */
	incise_wall_peer_close(peer);
	return false;
}

/* A step leaves CLOCK_REALTIME, a suspend CLOCK_MONOTONIC_RAW without what was known of it. */
static void follow_clocks(struct incise_wall_peer *peer,
			  const struct incise_wall_clocks *now)
{
	const struct incise_wall_clocks *before = &peer->clocks;
	int64_t doubt_ns = now->half_ns + before->half_ns;
	int64_t raw_ns = now->raw_ns - before->raw_ns;
	int64_t sleep_ns =
		(now->boot_ns - now->mono_ns) - (before->boot_ns - before->mono_ns);
	int64_t step_ns =
		(now->real_ns - now->mono_ns) - (before->real_ns - before->mono_ns);

	if (before->raw_ns && llabs(sleep_ns) > SUSPEND_LEAST_NS + doubt_ns)
		peer->n = 0;
	if (before->raw_ns && llabs(step_ns) > STEP_LEAST_NS + doubt_ns)
		peer->stepped = true;
	else if (before->raw_ns && raw_ns > 0)
		peer->real_per_raw = (double)(now->real_ns - before->real_ns - raw_ns) /
				     (double)raw_ns;
	peer->clocks = *now;
}

/* The sync as a point of the line, unless it is known. */
static void add_sync(struct incise_wall_peer *peer, const struct incise_ptp_state *state,
		     const struct incise_wall_clocks *now, int utc_offset_s)
{
	const int most = sizeof(peer->syncs) / sizeof(*peer->syncs);
	double age_ns = (double)(now->real_ns - state->ingress_ns);
	struct incise_wall_sync sync = {
		.raw_ns = now->raw_ns - llrint(age_ns / (1 + peer->real_per_raw)),
		.tai_ns = state->ingress_ns - state->offset_ns +
			  utc_offset_s * INCISE_NS_PER_S,
	};

	if (state->ingress_ns == peer->updated)
		return;
	peer->updated = state->ingress_ns;
	/* It was before the step, by a clock that has gone. */
	if (peer->stepped) {
		peer->stepped = false;
		return;
	}
	if (peer->n && sync.raw_ns <= peer->syncs[peer->n - 1].raw_ns)
		peer->n = 0;
	if (peer->n == most) {
		memmove(peer->syncs, peer->syncs + 1, (most - 1) * sizeof(sync));
		peer->n--;
	}
	peer->syncs[peer->n++] = sync;
}

/* TAI now by the line through the syncs, and the bound of that without the path's. */
static int64_t extrapolate(const struct incise_wall_peer *peer, int64_t raw_ns,
			   double *bound_ns)
{
	const struct incise_wall_sync *last = &peer->syncs[peer->n - 1];
	double x0 = 0, y0 = 0, xx = 0, xy = 0, slope = 0, worst = 0;
	double ahead_ns = (double)(raw_ns - last->raw_ns);
	bool line = peer->n >= 4;

	for (int i = 0; i < peer->n; i++) {
		double x = (double)(peer->syncs[i].raw_ns - last->raw_ns);

		x0 += x / peer->n;
		y0 += ((double)(peer->syncs[i].tai_ns - last->tai_ns) - x) / peer->n;
	}
	for (int i = 0; i < peer->n; i++) {
		double x = (double)(peer->syncs[i].raw_ns - last->raw_ns);
		double y = (double)(peer->syncs[i].tai_ns - last->tai_ns) - x;

		xx += (x - x0) * (x - x0);
		xy += (x - x0) * (y - y0);
	}
	if (line && xx > 0)
		slope = xy / xx;
	else
		x0 = y0 = 0; /* through the last one */
	for (int i = 0; i < peer->n && line; i++) {
		double x = (double)(peer->syncs[i].raw_ns - last->raw_ns);
		double y = (double)(peer->syncs[i].tai_ns - last->tai_ns) - x;

		worst = fmax(worst, fabs(y - y0 - slope * (x - x0)));
	}
	/* The end of a line is less certain than its middle. */
	*bound_ns = 2 * worst + fabs(ahead_ns - x0) * WANDER_PPB * 1e-9 +
		    (line ? 0 : fabs(ahead_ns) * CRYSTAL_PPB * 1e-9);
	return last->tai_ns + (raw_ns - last->raw_ns) +
	       llrint(y0 + slope * (ahead_ns - x0));
}

static void name_reference(const struct incise_ptp_state *state, char reference[24])
{
	const uint8_t *id = state->gm;

	if (state->traceable)
		snprintf(reference, 24, "TAI");
	else
		snprintf(reference, 24, "ptp:%02x%02x%02x%02x%02x%02x%02x%02x", id[0],
			 id[1], id[2], id[3], id[4], id[5], id[6], id[7]);
}

void incise_wall_ptp_read(struct incise_wall_peer *peer,
			  const struct incise_wall_clocks *clocks,
			  struct incise_wall_statement *statement)
{
	struct incise_wall_reading *reading = &statement->reading;
	struct incise_ptp_state state = {0};
	double bound_ns;

	*statement = (struct incise_wall_statement){
		.reading = {.source = "ptp",
			    .reference = "TAI",
			    .utc_offset_s = clocks->utc_offset_s,
			    .updated = peer->updated}};
	memcpy(reading->leap, clocks->leap, sizeof(reading->leap));
	follow_clocks(peer, clocks);
	if (!ask_all(peer, &state))
		return;
	statement->answered = true;
	statement->of_card = state.hardware;
	/* A timescale that is not PTP's counts UTC: its number of leap seconds is not used. */
	if (state.ptp_timescale) {
		reading->utc_offset_s = state.utc_offset_s;
		snprintf(reading->leap, sizeof(reading->leap), "ptp");
	}
	/* The offset is of the network card's clock, and that of CLOCK_REALTIME is not known. */
	if (state.hardware)
		return;
	name_reference(&state, reading->reference);
	if (!state.gm_present && state.master && !state.slave) {
		/* Only "ptp" goes on when the master is lost: this is another source. */
		snprintf(reading->source, sizeof(reading->source), "ptp-master");
		reading->good = true;
		reading->bound_ns = OWN_BOUND_NS;
		reading->rate_uncertainty_ppb = WANDER_PPB;
		reading->updated = ++peer->updated;
		return;
	}
	/* Without a measured delay of the path there is no bound. */
	if (!state.gm_present || !state.slave || !state.ingress_ns ||
	    state.path_delay_ns == 0 ||
	    llabs(clocks->real_ns - state.ingress_ns) > SAME_CLOCK_NS)
		return;
	if (memcmp(peer->gm, state.gm, sizeof(peer->gm)) != 0)
		peer->n = 0;
	memcpy(peer->gm, state.gm, sizeof(peer->gm));
	add_sync(peer, &state, clocks, reading->utc_offset_s);
	reading->updated = peer->updated;
	if (!peer->n || peer->stepped ||
	    clocks->raw_ns - peer->syncs[peer->n - 1].raw_ns > SYNC_AGE_NS)
		return;
	reading->good = true;
	reading->tai_ns = extrapolate(peer, clocks->raw_ns, &bound_ns);
	/* The two ways may differ by all of the delay: that is the limit. */
	reading->bound_ns = fabs(state.path_delay_ns) + bound_ns;
	reading->rate_uncertainty_ppb = peer->n >= 4 ? 1e3 : CRYSTAL_PPB;
	statement->tai_raw_ns = clocks->raw_ns;
}
