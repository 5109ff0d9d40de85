// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/wall_peers.c with sockets of a chronyd and a ptp4l that are made here, on
 * simulated clocks: the master is 3 s and 50 ppm from this machine, which is never set right.
 */
#include "../unit.h"
#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <sys/socket.h>
#include <sys/un.h>
#include "../../../lib/base/random.h"
#include "../../../lib/record/write/wall_sources.h"

#define S 1000000000LL
#define REAL_NS (1795741869 * S)
#define UTC_S 37
#define PPM 50e-6
#define PATH_NS 30000.0
#define ASYMMETRY_NS 20000.0
#define NOISE_NS 15000.0
/* A busy machine may take long to run the daemon's thread. */
#define PATIENCE_NS (60 * S)

enum manner { GOOD, SILENT, GARBAGE, WRONG_SEQUENCE, LOST, MASTER, HARDWARE };

static struct daemon {
	pthread_t thread;
	int fd, stop[2];
	enum manner manner;
	uint64_t random;
	bool chrony, no_delay;
	/* the state, set between requests */
	int64_t ingress_ns, offset_ns, correction_ns, ref_ns;
	uint8_t flags; /* of TIME_PROPERTIES */
	uint8_t gm;
	_Atomic int requests;
} d;
static struct incise_wall_peer peer;
static struct incise_wall_statement statement;

static void put(uint8_t *to, uint64_t value, int n)
{
	while (n--) {
		to[n] = value & 0xff;
		value >>= 8;
	}
}

/* As chronyd packs: 7 bits of exponent, 25 of coefficient. */
static void put_float(uint8_t *to, double value)
{
	int exponent;
	double share = frexp(value, &exponent);

	put(to,
	    (uint64_t)((exponent + 1) & 0x7f) << 25 |
		    ((uint64_t)llrint(share * (1 << 24)) & 0x1ffffff),
	    4);
}

static size_t answer_chrony(const uint8_t *request, uint8_t *out)
{
	memset(out, 0, 104);
	out[0] = 6;
	out[1] = 2;
	put(out + 4, 33, 2);
	put(out + 6, 5, 2);
	memcpy(out + 16, request + 8, 4);
	put(out + 28, d.manner == LOST ? 0x7f7f0101 : 0xc0a80001, 4);
	put(out + 52, 2, 2);
	put(out + 60, (uint64_t)(d.ref_ns / S), 4);
	put(out + 64, (uint64_t)(d.ref_ns % S), 4);
	put_float(out + 68, (double)d.correction_ns * 1e-9);
	put_float(out + 84, 0.01);
	put_float(out + 88, 0.05);
	put_float(out + 92, 400e-6);
	put_float(out + 96, 100e-6);
	return 104;
}

static size_t answer_ptp(const uint8_t *request, uint8_t *out)
{
	int id = request[52] << 8 | request[53];
	uint8_t *data = out + 54;
	size_t size = 0;

	memcpy(out, request, 54);
	memset(data, 0, 100);
	out[46] = 2;
	switch (id) {
	case 0xc000:
		put(data, (uint64_t)d.offset_ns, 8);
		put(data + 8, (uint64_t)d.ingress_ns, 8);
		data[41] = d.manner != LOST && d.manner != MASTER;
		memset(data + 42, d.gm, 8);
		size = 50;
		break;
	case 0x2001:
		put(data + 10, d.no_delay ? 0 : (uint64_t)PATH_NS << 16, 8);
		size = 18;
		break;
	case 0x2003:
		put(data, UTC_S, 2);
		data[2] = d.flags;
		size = 4;
		break;
	case 0xc004:
		data[11] = d.manner == HARDWARE;
		data[12] = 4;
		memcpy(data + 13, "eth0", 4);
		size = 17;
		break;
	case 0x2004:
		/* as ptp4l with free_running: uncalibrated */
		data[10] = d.manner == LOST || d.manner == MASTER ? 6 : 8;
		size = 26;
		break;
	}
	put(out + 2, 54 + size, 2);
	put(out + 50, 2 + size, 2);
	return 54 + size;
}

static void *run(void *argument)
{
	struct pollfd wait[] = {{.fd = d.fd, .events = POLLIN},
				{.fd = d.stop[0], .events = POLLIN}};
	uint8_t request[1500], reply[1500];

	while (poll(wait, 2, -1) > 0 && !wait[1].revents) {
		struct sockaddr_storage from;
		socklen_t length = sizeof(from);
		ssize_t n = recvfrom(d.fd, request, sizeof(request), 0,
				     (struct sockaddr *)&from, &length);
		size_t size;

		if (n < 54)
			continue;
		d.requests++;
		size = d.chrony ? answer_chrony(request, reply)
				: answer_ptp(request, reply);
		if (d.manner == WRONG_SEQUENCE)
			reply[d.chrony ? 19 : 31] ^= 1;
		if (d.manner == GARBAGE)
			for (size_t i = 0; i < size; i++)
				reply[i] = incise_random_next(&d.random) & 0xff;
		if (d.manner != SILENT)
			sendto(d.fd, reply, size, 0, (struct sockaddr *)&from, length);
	}
	return NULL;
}

static char folder[] = "/tmp/incise-peers-XXXXXX";
static char path[64];

static void start(bool chrony)
{
	struct sockaddr_un name = {.sun_family = AF_UNIX};
	struct sockaddr_in address = {.sin_family = AF_INET,
				      .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
	socklen_t length = sizeof(address);

	d = (struct daemon){.chrony = chrony, .random = 1, .gm = 0xaa};
	incise_wall_peer_init(&peer);
	peer.patience_ns = PATIENCE_NS;
	d.fd = socket(chrony ? AF_INET : AF_UNIX, SOCK_DGRAM, 0);
	if (chrony) {
		assert_int_equal(bind(d.fd, (struct sockaddr *)&address, length), 0);
		getsockname(d.fd, (struct sockaddr *)&address, &length);
		peer.port = ntohs(address.sin_port);
	} else {
		strcpy(name.sun_path, path);
		strcpy(peer.path, path);
		assert_int_equal(bind(d.fd, (struct sockaddr *)&name, sizeof(name)), 0);
	}
	assert_int_equal(pipe(d.stop), 0);
	assert_int_equal(pthread_create(&d.thread, NULL, run, NULL), 0);
}

static int start_ptp(void **state)
{
	start(false);
	return 0;
}

static int start_chrony(void **state)
{
	start(true);
	return 0;
}

static int stop(void **state)
{
	assert_int_equal(write(d.stop[1], "", 1), 1);
	pthread_join(d.thread, NULL);
	close(d.fd);
	close(d.stop[0]);
	close(d.stop[1]);
	unlink(path);
	incise_wall_peer_close(&peer);
	return 0;
}

/* The daemon's thread may run later than those who gave its answer up. */
static void await_request(void)
{
	for (int ms = 0; !d.requests; ms++) {
		if (ms == PATIENCE_NS / 1000000)
			fail_msg("no request came");
		usleep(1000);
	}
}

/* The clocks after so much true time; none is set right. */
static struct incise_wall_clocks clocks_at(double s)
{
	int64_t mono_ns = 1000 * S + llrint(s * 1e9 * (1 + PPM));

	return (struct incise_wall_clocks){.mono_ns = mono_ns,
					   .raw_ns = mono_ns - 5 * S,
					   .boot_ns = mono_ns + S,
					   .real_ns = REAL_NS + mono_ns,
					   .half_ns = 100,
					   .utc_offset_s = UTC_S,
					   .leap = "list"};
}

/* UTC of the master: at the start 3 s behind this machine. */
static int64_t master_ns(double s)
{
	return REAL_NS + 1000 * S - 3 * S + llrint(s * 1e9);
}

/* A sync a third of a second ago; the offset has the asymmetry of the path, and noise. */
static void sync_at(double s)
{
	struct incise_wall_clocks clocks = clocks_at(s - 0.3);

	d.ingress_ns = clocks.real_ns;
	d.offset_ns =
		clocks.real_ns - master_ns(s - 0.3) +
		llrint(ASYMMETRY_NS + NOISE_NS * incise_random_symmetric(&d.random));
}

static struct incise_wall_statement ask_at(double s)
{
	struct incise_wall_clocks clocks = clocks_at(s);

	incise_wall_ptp_read(&peer, &clocks, &statement);
	return statement;
}

static void check_ptp(const struct incise_wall_reading *r, double s, double most_ns)
{
	double error_ns = (double)(r->tai_ns - (master_ns(s) + UTC_S * S));

	assert_true(r->good);
	if (fabs(error_ns) > r->bound_ns)
		fail_msg("at %g s: %g ns wrong, stated %g", s, error_ns, r->bound_ns);
	assert_true(r->bound_ns < most_ns);
}

/*
 * Free running: the offset is applied. The bound is the path's delay, twice the largest distance
 * from the line, 15 µs of noise, and what 0.3 s at 200 ppm are until the rate is known.
 */
TEST(offset_of_ptp4l_is_applied, start_ptp, stop)
{
	d.no_delay = true;
	sync_at(0.5);
	assert_false(ask_at(0.5).reading.good);
	d.no_delay = false;
	for (int s = 1; s < 60; s++) {
		sync_at(s);
		ask_at(s);
		check_ptp(&statement.reading, s,
			  PATH_NS + (s < 4 ? 60100 : 2 * 2 * NOISE_NS + 2000));
		assert_string_equal(statement.reading.source, "ptp");
		assert_string_equal(statement.reading.reference, "ptp:aaaaaaaaaaaaaaaa");
	}
}

TEST(timescale_and_traceability, start_ptp, stop)
{
	d.flags = 1 << 2 | 1 << 3 | 1 << 4;
	sync_at(1);
	ask_at(1);
	assert_string_equal(statement.reading.reference, "TAI");
	assert_string_equal(statement.reading.leap, "ptp");
	check_ptp(&statement.reading, 1, 1e6);
}

TEST(lost_master_is_no_master, start_ptp, stop)
{
	for (int s = 1; s < 10; s++) {
		sync_at(s);
		ask_at(s);
	}
	assert_true(statement.reading.good);
	/* No sync for 5 s, though the daemon says that it is a slave. */
	assert_true(ask_at(12).reading.good);
	assert_false(ask_at(15.5).reading.good);
	/* It makes itself the master: the time of another source and reference. */
	d.manner = LOST;
	d.gm = 0xbb;
	ask_at(16);
	assert_string_equal(statement.reading.source, "ptp-master");
	assert_string_equal(statement.reading.reference, "ptp:bbbbbbbbbbbbbbbb");
	/* Back again. */
	d.manner = GOOD;
	d.gm = 0xaa;
	sync_at(17);
	ask_at(17);
	check_ptp(&statement.reading, 17, 1e6);
	/* The time of a hardware clock is not that of CLOCK_REALTIME, however near. */
	d.manner = HARDWARE;
	ask_at(17);
	assert_false(statement.reading.good);
	assert_true(statement.answered && statement.of_card);
	d.manner = GOOD;
	ask_at(17);
	assert_true(statement.reading.good);
	assert_true(statement.answered && !statement.of_card);
	d.ingress_ns += UTC_S * S;
	assert_false(ask_at(18).reading.good);
}

/* The first sync after a step may be from before it. */
TEST(syncs_around_a_step, start_ptp, stop)
{
	struct incise_wall_clocks clocks;

	for (int s = 1; s < 10; s++) {
		sync_at(s);
		ask_at(s);
	}
	/* A sync at 9.7 s, a step by 1 s at 9.8 s, read at 10 s. */
	sync_at(10);
	clocks = clocks_at(10);
	clocks.real_ns += S;
	incise_wall_ptp_read(&peer, &clocks, &statement);
	if (statement.reading.good)
		check_ptp(&statement.reading, 10, 1e6);
	for (int s = 11; s < 15; s++) {
		sync_at(s);
		d.ingress_ns += S;
		d.offset_ns += S;
		clocks = clocks_at(s);
		clocks.real_ns += S;
		incise_wall_ptp_read(&peer, &clocks, &statement);
		check_ptp(&statement.reading, s, PATH_NS + 4 * NOISE_NS + 2000);
	}
}

TEST(bad_answers_are_none)
{
	static const enum manner manners[] = {SILENT, GARBAGE, WRONG_SEQUENCE};
	struct incise_wall_clocks clocks = clocks_at(1);

	for (int chrony = 0; chrony < 2; chrony++)
		for (int i = 0; i < 3; i++) {
			start(chrony);
			d.manner = manners[i];
			/* It waits for all of this, however busy the machine is. */
			peer.patience_ns = S / 20;
			sync_at(1);
			for (int k = 0; k < 3; k++) {
				if (chrony)
					incise_wall_chrony_read(&peer, &clocks,
								&statement);
				else
					incise_wall_ptp_read(&peer, &clocks, &statement);
				assert_false(statement.reading.good);
			}
			await_request();
			/* And then it answers. */
			d.manner = GOOD;
			peer.patience_ns = PATIENCE_NS;
			if (chrony)
				incise_wall_chrony_read(&peer, &clocks, &statement);
			else
				incise_wall_ptp_read(&peer, &clocks, &statement);
			assert_true(statement.reading.good);
			stop(NULL);
		}
	/* Nobody is there. */
	incise_wall_peer_init(&peer);
	strcpy(peer.path, path);
	incise_wall_ptp_read(&peer, &clocks, &statement);
	assert_false(statement.reading.good);
}

TEST(tracking_of_chronyd, start_chrony, stop)
{
	struct incise_wall_clocks clocks = clocks_at(1);

	d.correction_ns = -2500000; /* the clock is fast */
	d.ref_ns = REAL_NS + 123456789;
	incise_wall_chrony_read(&peer, &clocks, &statement);
	assert_true(statement.reading.good);
	/* 25 bits of 2.5 ms; half of the delay, the dispersion, and a slew of 2.5 ms at most */
	assert_true(fabs(statement.offset_ns - 2500000) < 1);
	assert_true(statement.reading.bound_ns >= 299999 &&
		    statement.reading.bound_ns <= 2800001);
	assert_true(fabs(statement.reading.rate_uncertainty_ppb - 60) < 1e-3);
	assert_int_equal(statement.reading.updated, d.ref_ns);
	d.manner = LOST;
	incise_wall_chrony_read(&peer, &clocks, &statement);
	assert_false(statement.reading.good);
	assert_true(statement.answered); /* without a time, which is no silence */
}

TEST(list_of_leap_seconds)
{
	char good[] = "#\tcomment\n#@\t3991593600\n2272060800\t10\t# 1 Jan 1972\n"
		      "3692217600\t37\n",
	     reversed[] = "#@ 3991593600\n3692217600 37\n2272060800 10\n",
	     endless[] = "2272060800 10\n", nothing[] = "";
	struct incise_leap_list list;

	assert_true(incise_leap_list_read(&list, good));
	assert_int_equal(list.n, 2);
	assert_int_equal(list.expires_s, 1782604800); /* 2026-06-28 */
	assert_int_equal(list.leaps[1].from_s, 1483228800);
	assert_int_equal(list.leaps[1].offset_s, 37);
	assert_false(incise_leap_list_read(&list, reversed));
	assert_false(incise_leap_list_read(&list, endless));
	assert_false(incise_leap_list_read(&list, nothing));
}

static int make_folder(void **state)
{
	if (!mkdtemp(folder))
		return -1;
	snprintf(path, sizeof(path), "%s/ptp4l", folder);
	return 0;
}

static int remove_folder(void **state)
{
	return rmdir(folder);
}

GROUP(make_folder, remove_folder);
