// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/vrpn: what VRPN's own classes, version 07.38, sent and accepted. tests/fuzz/vrpn_device/recorded.*
 * are the bytes of a connection of tests/vrpn/server.cc to the backend `haptic`, both ways; the
 * server printed each force of them.
 */
#include <arpa/inet.h>
#include <endian.h>
#include <fcntl.h>
#include <float.h>
#include <limits.h>
#include <poll.h>
#include <pthread.h>
#include <sys/socket.h>
#include "../unit.h"
#include "../../../lib/base/monotonic.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/device/vrpn/vrpn_device.h"

#define SERVER_MAX 16384
#define LAST_FRAME 9472 /* from here on the pose that the last force is of */
#define NAMES 128	/* bytes: cookie, and the names of device and force field */
#define FIELD 88
#define FIELDS 8

extern const struct incise_backend incise_haptic_vrpn, incise_tracker_vrpn;

static uint8_t server[SERVER_MAX], client[SERVER_MAX];
static size_t server_n, client_n;
static struct vrpn_device device;
static int ends[2];

static size_t load(const char *path, uint8_t *to)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC);
	ssize_t n = fd < 0 ? 0 : read(fd, to, SERVER_MAX);

	assert_true(n > 0 && n < SERVER_MAX);
	close(fd);
	return (size_t)n;
}

static int load_recorded(void **state)
{
	server_n = load("tests/fuzz/vrpn_device/recorded.server", server);
	client_n = load("tests/fuzz/vrpn_device/recorded.client", client);
	return 0;
}

GROUP(load_recorded, NULL);

static int connect_pair(void **state)
{
	memset(&device, 0, sizeof(device));
	vrpn_device_init(&device, 1, INT64_MAX);
	snprintf(device.device, sizeof(device.device), "Tool");
	assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
	device.link.fd = ends[0];
	return 0;
}

static int close_pair(void **state)
{
	close(ends[0]);
	close(ends[1]);
	return 0;
}

static int put(const void *bytes, size_t n)
{
	assert_int_equal(write(ends[1], bytes, n), n);
	return vrpn_device_receive(&device);
}

/* --- bytes --------------------------------------------------------------------------- */

/* Poses of sensor 0 of a replay in parts of @part bytes; returns their number. */
static int replay(size_t part, struct vrpn_pose *poses, int capacity)
{
	int n = 0;

	for (size_t at = 0; at < server_n; at += part) {
		assert_int_equal(
			put(server + at, part < server_n - at ? part : server_n - at), 0);
		while (n < capacity && vrpn_device_pose(&device, &poses[n]) == 1)
			n++;
	}
	assert_int_equal(device.haptic.error, 0);
	return n;
}

static void check_numbers(const double *is, const double *expected, int n)
{
	for (int i = 0; i < n; i++)
		assert_true(is[i] == expected[i]);
}

/* As an independent program of Python reads the bytes. */
TEST(each_pose_is_right_to_the_last_bit, connect_pair, close_pair)
{
	static const double first[] = {0x1.3d6e5df72a4aap+5,
				       0x1.804ff2e5a5fe7p+5,
				       0x1.a4dad066201e5p+3,
				       0x1.e848bde621787p-1,
				       0x0.0p+0,
				       0x0.0p+0,
				       0x1.340af4bc42588p-2};
	static const double last[] = {0x1.5c99ed42fff1ep+5,
				      0x1.f4a6154325202p+1,
				      -0x1.336ef38694816p+5,
				      0x1.896cf3619908bp-1,
				      0x0.0p+0,
				      0x0.0p+0,
				      0x1.47a8a8cf7f1e8p-1};
	static const double velocity[] = {-0x1.884fd66c3e215p+4, -0x1.8f5244ccc57cfp+5,
					  -0x1.d6b4846ea9d78p+4};
	struct vrpn_pose poses[32];
	int n = replay(server_n, poses, 32);

	assert_int_equal(n, 15);
	check_numbers(poses[0].sample.position_mm, first, 3);
	check_numbers(poses[0].sample.quaternion, first + 3, 4);
	check_numbers(poses[14].sample.position_mm, last, 3);
	check_numbers(poses[14].sample.quaternion, last + 3, 4);
	check_numbers(poses[14].sample.velocity_mm_s, velocity, 3);
	assert_int_equal(poses[0].utc_ns, 1796050357456037000);
	/* The formula of the server, whose functions may differ in the last bits. */
	for (int i = 0; i < n; i++)
		for (int k = 0; k < 3; k++)
			assert_true(fabs(poses[i].sample.position_mm[k] -
					 (50 * sin((11 + i) / 12.0 + k) + k)) < 1e-9);
	assert_int_equal(device.haptic.info.buttons, 2);
}

TEST(parts_of_any_size_give_the_same, connect_pair, close_pair)
{
	static const size_t parts[] = {1, 2, 7, 8, 23, 24, 25, 88, 1000, 4096};
	struct vrpn_pose whole[32], poses[32];
	int n = replay(server_n, whole, 32), given;

	for (size_t p = 0; p < sizeof(parts) / sizeof(*parts); p++) {
		close_pair(NULL);
		connect_pair(NULL);
		given = 0;
		/* A pose that is given before its velocity came has none. */
		assert_int_equal(replay(parts[p], poses, 32), n);
		for (int i = 0; i < n; i++) {
			check_numbers(poses[i].sample.position_mm,
				      whole[i].sample.position_mm, 3);
			check_numbers(poses[i].sample.quaternion,
				      whole[i].sample.quaternion, 4);
			if (isfinite(poses[i].sample.velocity_mm_s[0]))
				check_numbers(poses[i].sample.velocity_mm_s,
					      whole[i].sample.velocity_mm_s, 3);
			given += isfinite(poses[i].sample.velocity_mm_s[0]);
		}
		assert_true(given == n || parts[p] < 200 || given > 0);
	}
}

/* A message of our own: a description, or one of numbers. */
static void send_message(int32_t sender, int32_t type, const void *payload, size_t n)
{
	struct timespec now;
	uint8_t bytes[512] = {0};
	uint32_t words[5];

	clock_gettime(CLOCK_REALTIME, &now);
	words[0] = htobe32((uint32_t)(24 + n));
	words[1] = htobe32((uint32_t)now.tv_sec);
	words[2] = htobe32((uint32_t)(now.tv_nsec / 1000));
	words[3] = htobe32((uint32_t)sender);
	words[4] = htobe32((uint32_t)type);
	memcpy(bytes, words, sizeof(words));
	memcpy(bytes + 24, payload, n);
	assert_int_equal(put(bytes, 24 + (n + 7) / 8 * 8), 0);
}

static void describe(int32_t kind, int32_t number, const char *name)
{
	uint8_t payload[128] = {0, 0, 0, (uint8_t)(strlen(name) + 1)};

	memcpy(payload + 4, name, strlen(name) + 1);
	send_message(number, kind, payload, 4 + strlen(name) + 1);
}

static void send_pose(int32_t sender, int32_t type, const double values[7])
{
	uint64_t payload[8] = {0};

	for (int i = 0; i < 7; i++) {
		memcpy(&payload[1 + i], &values[i], sizeof(double));
		payload[1 + i] = htobe64(payload[1 + i]);
	}
	send_message(sender, type, payload, sizeof(payload));
}

static int count_poses(struct vrpn_pose *pose)
{
	int n = 0;

	while (vrpn_device_pose(&device, pose) == 1)
		n++;
	return n;
}

TEST(names_may_come_late_and_twice, connect_pair, close_pair)
{
	static const double here[7] = {0.1, 0.2, 0.3, 0, 0, 0, 1};
	struct vrpn_pose pose;

	assert_int_equal(put("vrpn: ver. 07.30  0\0\0\0\0\0", 24), 0);
	send_pose(5, 9, here);
	assert_int_equal(count_poses(&pose), 0);
	describe(-2, 9, "vrpn_Tracker Pos_Quat");
	send_pose(5, 9, here);
	assert_int_equal(count_poses(&pose), 0);
	describe(-1, 5, "Tool");
	describe(-1, 5, "Tool");
	describe(-1, 6, "Tools");
	describe(-2, 9, "vrpn_Tracker Pos_Quat");
	send_pose(6, 9, here);
	send_pose(5, 8, here);
	assert_int_equal(count_poses(&pose), 0);
	send_pose(5, 9, here);
	assert_int_equal(count_poses(&pose), 1);
	assert_true(pose.sound && pose.sample.position_mm[2] == 1000 * 0.3);
	/* The number is that of another type now. */
	describe(-2, 9, "vrpn_Analog Channel");
	send_pose(5, 9, here);
	assert_int_equal(count_poses(&pose), 0);
	/* Another device has the name: for good. */
	describe(-1, 7, "Tool");
	assert_int_equal(vrpn_device_pose(&device, &pose), -EPROTO);
	assert_int_equal(vrpn_device_receive(&device), -EPROTO);
	assert_non_null(strstr(device.haptic.cause, "another number"));
}

TEST(poses_that_are_none_are_not_sound, connect_pair, close_pair)
{
	static const double bad[][7] = {
		{NAN, 0, 0, 0, 0, 0, 1},      {0, INFINITY, 0, 0, 0, 0, 1},
		{0, 0, 1e4, 0, 0, 0, 1},      {0, 0, 0, 0, 0, 0, 0},
		{0, 0, 0, 0, 0, 0, NAN},      {0, 0, 0, 1, 0, 0, 1},
		{0, 0, 0, 1e200, 0, 0, 1e200}};
	static const double long_one[7] = {0, 0, 0, 0, 0, 0, 1.005};
	struct vrpn_pose pose;

	assert_int_equal(put("vrpn: ver. 07.38  0\0\0\0\0\0", 24), 0);
	describe(-1, 1, "Tool");
	describe(-2, 2, "vrpn_Tracker Pos_Quat");
	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		send_pose(1, 2, bad[i]);
		assert_int_equal(count_poses(&pose), 1);
		assert_false(pose.sound);
	}
	/* However many come. */
	device.silent_ns = 1;
	assert_int_equal(vrpn_device_receive(&device), -EIO);
	device.silent_ns = INT64_MAX;
	device.haptic.error = 0;
	send_pose(1, 2, long_one);
	assert_int_equal(count_poses(&pose), 1);
	assert_true(pose.sound && pose.sample.quaternion[0] == 1);
	/* Half a pose, and one too long. */
	send_message(1, 2, bad, 32);
	send_message(1, 2, bad, 72);
	assert_int_equal(count_poses(&pose), 0);
}

TEST(what_is_no_vrpn_ends_it_with_a_cause, connect_pair, close_pair)
{
	static const struct {
		const char *bytes;
		size_t n;
	} cases[] = {
		{"HTTP/1.1", 8},
		{"vrpn: ver. 06.00  0\0\0\0\0\0", 24},
		{"vrpn: ver. 07.38  0\0\0\0\0\0\0\0\0\x17\0\0\0\0\0\0\0\0\0\0\0\0"
		 "\0\0\0\0\0\0\0\0",
		 48},
		{"vrpn: ver. 07.38  0\0\0\0\0\0\xff\xff\xff\xff\0\0\0\0\0\0\0\0\0\0\0\0"
		 "\0\0\0\0\0\0\0\0",
		 48}};
	struct vrpn_pose pose;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		close_pair(NULL);
		connect_pair(NULL);
		assert_int_equal(put(cases[i].bytes, cases[i].n), 0);
		assert_int_equal(vrpn_device_pose(&device, &pose), -EPROTO);
		assert_non_null(strstr(device.haptic.cause, "VRPN 07"));
	}
}

TEST(times_of_this_machine_are_exact, connect_pair, close_pair)
{
	static const double here[7] = {0, 0, 0, 0, 0, 0, 1};
	struct vrpn_pose pose;
	int64_t before_ns = incise_monotonic_ns(), after_ns;

	device.own_machine = true;
	assert_int_equal(put("vrpn: ver. 07.38  0\0\0\0\0\0", 24), 0);
	describe(-1, 1, "Tool");
	describe(-2, 2, "vrpn_Tracker Pos_Quat");
	send_pose(1, 2, here);
	after_ns = incise_monotonic_ns();
	assert_int_equal(count_poses(&pose), 1);
	/* Timestamps are in whole microseconds, rounded down. */
	assert_true(pose.sample.t_ns >= before_ns - 2000 &&
		    pose.sample.t_ns <= after_ns + 1000);
}

/* --- the backends -------------------------------------------------------------------- */

/* The recorded server: a thread of its own while the device is opened, then the test itself. */
struct peer {
	int listener, fd;
	pthread_t thread;
	char arguments[64];
	uint8_t got[SERVER_MAX];
	size_t n;
};

static void serve_bytes(const struct peer *peer, const uint8_t *bytes, size_t n)
{
	assert_int_equal(send(peer->fd, bytes, n, MSG_NOSIGNAL), n);
}

static void *accept_client(void *argument)
{
	struct peer *peer = argument;

	peer->fd = accept(peer->listener, NULL, NULL);
	serve_bytes(peer, server, LAST_FRAME);
	return NULL;
}

static void start_peer(struct peer *peer)
{
	struct sockaddr_in address = {.sin_family = AF_INET,
				      .sin_addr = {htonl(INADDR_LOOPBACK)}};
	socklen_t size = sizeof(address);

	memset(peer, 0, sizeof(*peer));
	peer->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
	assert_int_equal(bind(peer->listener, (void *)&address, size), 0);
	assert_int_equal(listen(peer->listener, 1), 0);
	getsockname(peer->listener, (void *)&address, &size);
	snprintf(peer->arguments, sizeof(peer->arguments), "Tool@127.0.0.1:%d",
		 ntohs(address.sin_port));
	assert_int_equal(pthread_create(&peer->thread, NULL, accept_client, peer), 0);
}

static void serve_last_frame(const struct peer *peer)
{
	serve_bytes(peer, server + LAST_FRAME, server_n - LAST_FRAME);
}

static void receive_exactly(struct peer *peer, size_t n)
{
	assert_int_equal(recv(peer->fd, peer->got, n, MSG_WAITALL), n);
	peer->n = n;
}

/* All that came until the device has closed, which @close does. */
static void close_haptic(struct incise_haptic *haptic, struct peer *peer)
{
	ssize_t n;

	/* It does not wait for a server that ends. */
	shutdown(peer->fd, SHUT_WR);
	haptic->ops->close(haptic);
	while ((n = recv(peer->fd, peer->got + peer->n, sizeof(peer->got) - peer->n, 0)) >
	       0)
		peer->n += (size_t)n;
	close(peer->fd);
	close(peer->listener);
}

static struct incise_haptic *open_haptic(struct peer *peer)
{
	struct incise_backend_request request = {.where = "rig.conf:1: haptic"};
	struct incise_haptic *haptic;

	start_peer(peer);
	request.arguments = peer->arguments;
	haptic = incise_haptic_vrpn.open(&request, &err);
	succeeds(haptic);
	pthread_join(peer->thread, NULL);
	/* However slow this machine is. */
	((struct vrpn_device *)haptic)->silent_ns = INT64_MAX;
	return haptic;
}

static struct incise_haptic_sample read_sample(struct incise_haptic *haptic)
{
	const struct server_link *link = &((struct vrpn_device *)haptic)->link;
	struct incise_haptic_sample sample;
	int n;

	while (!(n = incise_haptic_read(haptic, &sample, 1)))
		server_link_wait(link, link->fd, POLLIN, INT_MAX);
	assert_int_equal(n, 1);
	return sample;
}

/* But for the two words of the time of each message. */
static void check_sent(const uint8_t *is, const uint8_t *expected, size_t n)
{
	for (size_t at = 0; at < n;
	     at += (ntohl(*(const uint32_t *)(expected + at)) + 7) / 8 * 8) {
		size_t size = ntohl(*(const uint32_t *)(expected + at));

		assert_memory_equal(is + at, expected + at, 4);
		assert_memory_equal(is + at + 12, expected + at + 12, size - 12);
	}
}

TEST(a_force_goes_out_as_vrpn_accepted_it)
{
	struct incise_haptic_info info;
	struct incise_haptic_sample sample;
	struct incise_haptic *haptic;
	double force_N[3] = {0};
	struct peer peer;

	haptic = open_haptic(&peer);
	incise_haptic_info(haptic, &info);
	assert_true(info.rate_hz > 11.9 && info.rate_hz < 12.1 &&
		    info.features & INCISE_HAPTIC_PAGE_VELOCITY);
	assert_int_equal(info.buttons, 2);
	assert_true(info.deadman_s == 0 && strstr(info.note, "keeps the last force"));
	serve_last_frame(&peer);
	sample = read_sample(haptic);
	assert_int_equal(sample.seq, 0);
	force_N[2] = -0.1 * sample.position_mm[2];
	haptic->info.peak_N = 5;
	assert_int_equal(incise_haptic_push(haptic, force_N, NULL), 0);
	close_haptic(haptic, &peer);
	assert_int_equal(peer.n, NAMES + 2 * FIELD);
	assert_memory_equal(peer.got, client, 24);
	check_sent(peer.got + 24, client + 24, NAMES - 24);
	check_sent(peer.got + NAMES, client + NAMES + (FIELDS - 1) * FIELD, 2 * FIELD);
}

/* The force of field @i, and its radius. */
static void get_field(const struct peer *peer, size_t i, double values[4])
{
	static const size_t at[4] = {12, 16, 20, FIELD - 24 - 4};

	for (int k = 0; k < 4; k++) {
		uint32_t word;
		float single;

		memcpy(&word, peer->got + NAMES + i * FIELD + 24 + at[k], sizeof(word));
		word = be32toh(word);
		memcpy(&single, &word, sizeof(single));
		values[k] = (double)single;
	}
}

TEST(no_force_above_the_peak_or_without_a_known_one)
{
	static const struct {
		double peak_N, force_N[3], least_N, most_N;
	} cases[] = {
		{0, {3, 4, 0}, 0, 0},	  {NAN, {3, 4, 0}, 0, 0},
		{6, {3, 4, 0}, 5, 5},	  {0.5, {3, 4, 0}, 0.4999998, 0.5},
		{3, {0, 0, 1e200}, 0, 3}, {1e300, {1e39, 0, 0}, 1e38, FLT_MAX},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_haptic *haptic;
		double sent_N[4];
		struct peer peer;

		haptic = open_haptic(&peer);
		haptic->info.peak_N = cases[i].peak_N;
		assert_int_equal(incise_haptic_push(haptic, cases[i].force_N, NULL), 0);
		close_haptic(haptic, &peer);
		get_field(&peer, 0, sent_N);
		assert_true(v3_length(sent_N) >= cases[i].least_N &&
			    v3_length(sent_N) <= cases[i].most_N);
	}
}

static const double some_N[3] = {1, 2, 3}, none_N[3];

static void assert_field(const struct peer *peer, size_t i, const double force_N[3],
			 double radius_m)
{
	double values[4];

	get_field(peer, i, values);
	check_numbers(values, force_N, 3);
	assert_true(values[3] == radius_m);
}

static void assert_broken(struct incise_haptic *haptic, const char *part)
{
	struct incise_haptic_sample sample = read_sample(haptic);
	char text[400];

	assert_int_equal(sample.flags, INCISE_HAPTIC_NOT_READY);
	assert_true(sample.position_mm[0] == 0x1.5c99ed42fff1ep+5);
	assert_true(incise_haptic_cause(haptic, text, sizeof(text)) > 0);
	assert_non_null(strstr(text, "VRPN Tool at 127.0.0.1"));
	assert_non_null(strstr(text, part));
	message_record(text);
	/* One sample. */
	assert_int_equal(incise_haptic_read(haptic, &sample, 1), 0);
	assert_int_equal(incise_haptic_push(haptic, some_N, NULL), 0);
}

static struct incise_haptic *open_with_force(struct peer *peer)
{
	struct incise_haptic *haptic = open_haptic(peer);

	haptic->info.peak_N = 5;
	serve_last_frame(peer);
	assert_int_equal(read_sample(haptic).flags, 0);
	assert_int_equal(incise_haptic_push(haptic, some_N, NULL), 0);
	return haptic;
}

/* The order of a connection that is made again, whenever its time is. */
TEST(a_connection_that_breaks_is_made_again_without_force)
{
	struct incise_haptic_sample sample;
	struct incise_haptic *haptic;
	uint64_t seq;
	struct peer peer;

	haptic = open_with_force(&peer);
	receive_exactly(&peer, NAMES + FIELD);
	assert_field(&peer, 0, some_N, 2);
	close(peer.fd);
	assert_broken(haptic, "closed the connection");
	/* It connects; then its cookie goes out. */
	((struct vrpn_device *)haptic)->retry_ns = 0;
	((struct vrpn_device *)haptic)->broken_ns = INT64_MAX;
	assert_int_equal(incise_haptic_read(haptic, &sample, 1), 0);
	accept_client(&peer);
	sample = read_sample(haptic);
	assert_int_equal(sample.flags, 0);
	for (seq = sample.seq; sample.seq < seq + 10; sample = read_sample(haptic))
		assert_int_equal(sample.flags, 0);
	assert_int_equal(seq, 2);
	/* The cause ends with its fault. */
	assert_string_equal(haptic->cause, "");
	incise_haptic_push(haptic, some_N, NULL);
	incise_haptic_push(haptic, none_N, NULL);
	incise_haptic_push(haptic, some_N, NULL);
	peer.n = 0;
	close_haptic(haptic, &peer);
	assert_int_equal(peer.n, NAMES + 4 * FIELD);
	assert_memory_equal(peer.got, client, 24);
	check_sent(peer.got + 24, client + 24, NAMES - 24);
	assert_field(&peer, 0, none_N, 2);
	assert_field(&peer, 1, none_N, 2);
	assert_field(&peer, 2, some_N, 2);
	assert_field(&peer, 3, none_N, 0);
}

TEST(a_server_that_is_gone_leaves_a_cause)
{
	struct incise_haptic_sample sample;
	struct incise_haptic *haptic;
	struct peer peer;
	char text[400];

	haptic = open_with_force(&peer);
	close(peer.fd);
	close(peer.listener);
	assert_broken(haptic, "closed the connection");
	((struct vrpn_device *)haptic)->broken_ns -= 10000000000;
	assert_int_equal(incise_haptic_read(haptic, &sample, 1), -ENODEV);
	assert_true(incise_haptic_cause(haptic, text, sizeof(text)) > 0);
	assert_non_null(strstr(text, "was not back after 10 s"));
	message_record(text);
	assert_int_equal(incise_haptic_push(haptic, none_N, NULL), -ENODEV);
	haptic->ops->close(haptic);
}

TEST(a_failure_ends_in_no_force)
{
	struct incise_haptic *haptic;
	struct peer peer;

	for (int i = 0; i < 2; i++) {
		haptic = open_with_force(&peer);
		if (i)
			serve_bytes(&peer, (const uint8_t[24]){0}, 24);
		else
			((struct vrpn_device *)haptic)->silent_ns = 0;
		assert_broken(haptic, i ? "VRPN 07 does not have" : "sends no poses");
		close_haptic(haptic, &peer);
		assert_int_equal(peer.n, NAMES + 2 * FIELD);
		assert_field(&peer, 1, none_N, 0);
	}
}

TEST(sensors_are_stations_of_a_tracker)
{
	static const struct incise_tracker_setup setup = {.n_stations = 2,
							  .stations = {1, 2},
							  .repeat_ms = 100,
							  .offset_mm = {0, 0, 10}};
	struct incise_backend_request request = {.where = "rig.conf:1: tracker",
						 .tracker = &setup};
	struct incise_tracker_sample samples[64];
	struct incise_tracker_info info;
	struct incise_tracker *tracker;
	struct vrpn_device *of;
	struct peer peer;
	int n;

	start_peer(&peer);
	request.arguments = peer.arguments;
	tracker = incise_tracker_vrpn.open(&request, &err);
	succeeds(tracker);
	pthread_join(peer.thread, NULL);
	tracker->ops->info(tracker, &info);
	assert_int_equal(info.stations, 2);
	assert_true(info.rate_hz > 23 && info.rate_hz < 26 && info.network);
	serve_last_frame(&peer);
	of = (struct vrpn_device *)tracker;
	do
		server_link_wait(&of->link, of->link.fd, POLLIN, INT_MAX);
	/* That of sensor 1 is not in the recording's last frame. */
	while (!(n = tracker->ops->read(tracker, samples, 64)));
	assert_int_equal(n, 1);
	assert_true(samples[0].station == 1 && samples[0].status == ' ');
	/* 10 mm along its z, which the turn about z leaves. */
	assert_true(fabs(samples[0].position_mm[0] - 0x1.5c99ed42fff1ep+5) < 1e-12);
	assert_true(fabs(samples[0].position_mm[2] - (-0x1.336ef38694816p+5 + 10)) <
		    1e-12);
	close(peer.fd);
	server_link_wait(&of->link, of->link.fd, POLLIN, INT_MAX);
	assert_int_equal(tracker->ops->read(tracker, samples, 64), 0);
	of->retry_ns = 0;
	of->broken_ns = INT64_MAX;
	assert_int_equal(tracker->ops->read(tracker, samples, 64), 0);
	accept_client(&peer);
	while (!(n = tracker->ops->read(tracker, samples, 64)))
		server_link_wait(&of->link, of->link.fd, POLLIN, INT_MAX);
	assert_true(n > 0 && samples[0].status == ' ' && samples[0].seq > 0);
	/* It sends a cookie alone. */
	receive_exactly(&peer, 24);
	tracker->ops->close(tracker);
	assert_true(recv(peer.fd, peer.got, sizeof(peer.got), 0) <= 0);
	close(peer.fd);
	close(peer.listener);
}

TEST(wrong_devices_are_one_line)
{
	static const char *const bad[] = {"",
					  "Tool",
					  "@host",
					  "Tool@",
					  "Tool@host:0",
					  "Tool@host:70000",
					  "Tool@host:1:2",
					  "Tool@[::1"};
	struct incise_backend_request request = {.where = "rig.conf:1: haptic"};

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		request.arguments = bad[i];
		assert_null(incise_haptic_vrpn.open(&request, &err));
		assert_int_equal(errno, EINVAL);
		assert_non_null(strstr(err.text, "vrpn:NAME@HOST:PORT"));
	}
}

TEST(hosts_and_ports)
{
	static const struct {
		const char *text, *host, *port, *rest;
		int rc;
	} cases[] = {
		{"a", "a", "3883", "", 0},
		{"a:1", "a", "1", "", 0},
		{"a:65535:b", "a", "65535", ":b", 0},
		{"[::1]", "::1", "3883", "", 0},
		{"[::1]:7:b", "::1", "7", ":b", 0},
		{"a:0", "", "", "", -ERANGE},
		{"a:65536", "", "", "", -ERANGE},
		{"a:1x", "", "", "", -ERANGE},
		{"a:", "", "", "", -EINVAL},
		{"[]", "", "", "", -EINVAL},
	};
	struct server_link link;
	char longest[sizeof(link.host) + 1] = "";
	const char *rest;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_int_equal(server_link_parse(&link, cases[i].text, 3883, &rest),
				 cases[i].rc);
		if (cases[i].rc)
			continue;
		assert_string_equal(link.host, cases[i].host);
		assert_string_equal(link.port, cases[i].port);
		assert_string_equal(rest, cases[i].rest);
	}
	memset(longest, 'a', sizeof(link.host) - 1);
	assert_int_equal(server_link_parse(&link, longest, 1, &rest), 0);
	assert_string_equal(link.host, longest);
	longest[sizeof(link.host) - 1] = 'a';
	assert_int_equal(server_link_parse(&link, longest, 1, &rest), -EINVAL);
}
