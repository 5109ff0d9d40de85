// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * the time from a pose to a client of incise serve, next to a bare socket, and
 * the wake-ups of the loop while eight clients receive.
 *
 *     pose at a source ─▶ incise serve ─ TCP ─▶ client here      latency: arrival - acquisition
 *     thread that sleeps and stamps ─── TCP ─▶ the same          bare socket, at the same time
 */
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>
#include <incise/state.h>
#include "../../lib/device/igtl/igtl_message.h"
#include "../../tools/cli/child.h"
#include "../../tools/cli/folder.h"
#include "../../tools/cli/stopwatch.h"
#include "program.h"

#define RATE_HZ 1000
#define PERIOD_NS (1000000000LL / RATE_HZ)
#define CLIENTS 8
#define SECONDS 5
#define QUICK_SECONDS 1
#define ROUNDS 4
#define QUICK_ROUNDS 1
#define PARTS 12
#define MESSAGES_MOST 4000000
#define WAIT_S 30
#define TEXT_SIZE 256

static int64_t clock_ns(clockid_t id)
{
	struct timespec now;

	clock_gettime(id, &now);
	return now.tv_sec * 1000000000LL + now.tv_nsec;
}

/* --- a client ------------------------------------------------------------------------ */

struct reader {
	pthread_t thread;
	int fd;
	bool poses; /* of OpenIGTLink; else 8 bytes with the time of CLOCK_MONOTONIC */
	double *us; /* latencies; NULL: not kept */
	_Atomic int n;
	_Atomic bool keep;
};

static void add(struct reader *reader, int64_t ns)
{
	int n = atomic_load(&reader->n);

	if (!reader->us || !atomic_load(&reader->keep) || n == MESSAGES_MOST)
		return;
	reader->us[n] = (double)ns * 1e-3;
	atomic_store(&reader->n, n + 1);
}

static void read_messages(struct reader *reader)
{
	struct incise_igtl_stream *stream = incise_igtl_stream_new(1 << 22);
	struct incise_igtl_message message;
	static _Thread_local uint8_t bytes[65536];
	ssize_t got;

	while ((got = recv(reader->fd, bytes, sizeof(bytes), 0)) > 0) {
		int64_t now_ns = clock_ns(CLOCK_REALTIME);
		const uint8_t *next = bytes;
		size_t n = (size_t)got;
		int found;

		while ((found = incise_igtl_stream_next(stream, &next, &n, &message)))
			if (found == -EPROTO)
				break;
			else if (found == 1 && !strcmp(message.name, "TipToTracker"))
				add(reader, now_ns - message.utc_ns);
	}
	incise_igtl_stream_free(stream);
}

static void *reader_run(void *context)
{
	struct reader *reader = context;
	int64_t stamp;

	if (reader->poses)
		read_messages(reader);
	else
		while (recv(reader->fd, &stamp, sizeof(stamp), MSG_WAITALL) ==
		       sizeof(stamp))
			add(reader, clock_ns(CLOCK_MONOTONIC) - stamp);
	return NULL;
}

static void reader_start(struct reader *reader, int fd, bool poses, double *us)
{
	*reader = (struct reader){.fd = fd, .poses = poses, .us = us};
	if (pthread_create(&reader->thread, NULL, reader_run, reader))
		cli_fail("no thread for a client");
}

static void reader_end(struct reader *reader)
{
	shutdown(reader->fd, SHUT_RDWR);
	pthread_join(reader->thread, NULL);
	close(reader->fd);
}

static int connect_to(int port)
{
	const struct sockaddr_in at = {.sin_family = AF_INET,
				       .sin_port = htons((uint16_t)port),
				       .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
	int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

	if (fd < 0 || connect(fd, (const struct sockaddr *)&at, sizeof(at)))
		cli_fail("127.0.0.1:%d: %s", port, strerror(errno));
	return fd;
}

/* --- a bare socket: wakes as often, sends the time ------------------------------------- */

struct bare {
	pthread_t thread;
	int fd;
	_Atomic bool stop;
};

static void *bare_run(void *context)
{
	struct bare *bare = context;
	int64_t due = clock_ns(CLOCK_MONOTONIC);

	while (!atomic_load(&bare->stop)) {
		struct timespec until = {due / 1000000000LL, due % 1000000000LL};

		clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
		/* From when it was due, as a pose counts from its acquisition. */
		if (send(bare->fd, &due, sizeof(due), MSG_NOSIGNAL) != sizeof(due))
			break;
		due += PERIOD_NS;
	}
	return NULL;
}

/* Both ends of a connection of TCP. */
static void bare_start(struct bare *bare, struct reader *reader, double *us)
{
	struct sockaddr_in at = {.sin_family = AF_INET,
				 .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
	socklen_t n = sizeof(at);
	int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), on = 1, fd;

	if (listener < 0 || bind(listener, (struct sockaddr *)&at, n) ||
	    listen(listener, 1) || getsockname(listener, (struct sockaddr *)&at, &n))
		cli_fail("a socket of this machine: %s", strerror(errno));
	fd = connect_to(ntohs(at.sin_port));
	*bare = (struct bare){.fd = accept(listener, NULL, NULL)};
	close(listener);
	setsockopt(bare->fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
	reader_start(reader, fd, false, us);
	if (pthread_create(&bare->thread, NULL, bare_run, bare))
		cli_fail("no thread for a socket");
}

static void bare_end(struct bare *bare)
{
	atomic_store(&bare->stop, true);
	pthread_join(bare->thread, NULL);
	close(bare->fd);
}

/* --- incise serve -------------------------------------------------------------------- */

struct server {
	pid_t pid;
	int port;
};

/* Its port is in a line that it prints with --verbose, behind that of the calibration. */
static int port_of(int fd)
{
	static const char line[] = "incise serve: OpenIGTLink on ";
	char text[TEXT_SIZE] = "", *at = NULL;
	size_t n = 0;
	ssize_t got;
	int port;

	while (n < sizeof(text) - 1 && !(at && strchr(at, '\n'))) {
		got = read(fd, text + n, sizeof(text) - 1 - n);
		if (got <= 0)
			break;
		n += (size_t)got;
		text[n] = '\0';
		at = strstr(text, line);
	}
	if (!at || sscanf(at + strlen(line), "127.0.0.1:%d", &port) != 1)
		cli_fail("incise serve: %.200s", *text ? text : "it ended at once");
	return port;
}

static struct server server_start(char *const source[2])
{
	char *program = cli_text("%s/incise-serve", cli_folder());
	char *rate = cli_text("%d", RATE_HZ);
	char *const more[] = {"--camera", "off", "--igtl",    "0",
			      "--rate",	  rate,	 "--verbose", NULL};
	char *argv[1 + 2 + N(more)] = {program, source[0], source[1]};
	struct server server;
	int pipes[2];

	memcpy(argv + (source[1] ? 3 : 2), more, sizeof(more));
	if (pipe2(pipes, O_CLOEXEC))
		cli_fail("pipe: %s", strerror(errno));
	server.pid = child_start(argv, -1, pipes[1]);
	close(pipes[1]);
	server.port = port_of(pipes[0]);
	/* It stays open: later lines, of few clients, fit into the pipe. */
	free(program);
	free(rate);
	return server;
}

static void server_end(const struct server *server)
{
	child_end(server->pid, 0);
}

/* An interrupted run leaves it: it is ended at exit. */
static struct {
	pid_t loop;
	char folder[4096];
} left;

static void clean_up(void)
{
	if (left.loop)
		child_end(left.loop, 0);
	if (*left.folder)
		folder_remove(left.folder);
	left.loop = 0;
	*left.folder = '\0';
}

/* --- latencies ----------------------------------------------------------------------- */

struct latency {
	const char *name;
	int messages;
	double hz, p50, p99, p999, max; /* us */
	struct harness_spread spread;	/* of the 99 % of parts of the time */
};

static void evaluate(struct latency *row, const char *name, double *us, int n,
		     double seconds)
{
	double parts[PARTS];
	int part = n / PARTS;

	row->name = name;
	row->messages = n;
	row->hz = n / seconds;
	row->spread = HARNESS_SPREAD_NONE;
	for (int i = 0; i < PARTS && part >= 100; i++) {
		stopwatch_sort(us + i * part, part);
		parts[i] = stopwatch_quantile(us + i * part, part, 0.99);
	}
	if (part >= 100)
		harness_spread(parts, PARTS, &row->spread);
	stopwatch_sort(us, n);
	row->p50 = stopwatch_quantile(us, n, 0.5);
	row->p99 = stopwatch_quantile(us, n, 0.99);
	row->p999 = stopwatch_quantile(us, n, 0.999);
	row->max = n ? us[n - 1] : NAN;
}

static void pause_s(double s)
{
	for (; s > 0 && !cli_stop; s -= 0.05)
		usleep(50000);
	if (cli_stop)
		cli_fail("interrupted");
}

/* Sources of the rig's poses have no latency of their own here. */
#define RIG "sim:tracker_hz=1000,tracker_latency_ms=0,tracker_jitter_ms=0"

static void measure_rig(struct latency rows[2], double seconds)
{
	double *us[2] = {cli_alloc(MESSAGES_MOST, sizeof(double)),
			 cli_alloc(MESSAGES_MOST, sizeof(double))};
	struct server server = server_start((char *[]){"--rig", RIG});
	struct reader client, echo;
	struct bare bare;

	cli_progress("rig to client, %.2g s", seconds);
	bare_start(&bare, &echo, us[0]);
	reader_start(&client, connect_to(server.port), true, us[1]);
	/* The first half second is the zero of the force. */
	pause_s(1);
	atomic_store(&client.keep, true);
	atomic_store(&echo.keep, true);
	pause_s(seconds);
	atomic_store(&client.keep, false);
	atomic_store(&echo.keep, false);
	reader_end(&client);
	bare_end(&bare);
	reader_end(&echo);
	server_end(&server);
	evaluate(&rows[0], "bare socket", us[0], echo.n, seconds);
	evaluate(&rows[1], "rig to client", us[1], client.n, seconds);
	free(us[0]);
	free(us[1]);
}

/* --- wake-ups of the loop ------------------------------------------------------------ */

struct wakes {
	const char *name;
	struct incise_state_histogram lateness;
	uint64_t ticks, skipped;
	double p50, p99, p999; /* us; upper edges of bins, 3 % wide */
	double parts[ROUNDS];
	struct harness_spread spread; /* of the 99 % of the rounds */
	int n;
};

static struct incise_state *state_open(const char *path)
{
	struct incise_state_now *now = cli_alloc(1, sizeof(*now));
	struct incise_state *state = NULL;

	for (double s = 0; s < WAIT_S && !cli_stop; s += 0.05, pause_s(0.05)) {
		if (!state)
			state = incise_state_open(path, NULL);
		if (state && !incise_state_read(state, now) &&
		    now->run == INCISE_RUN_RUNNING) {
			free(now);
			return state;
		}
	}
	cli_fail("incise haptic does not run after %d s", WAIT_S);
}

static void state_read(struct incise_state *state, struct incise_state_now *now)
{
	for (int i = 0; i < 1000; i++, usleep(1000))
		if (!incise_state_read(state, now))
			return;
	cli_fail("the status file of the loop cannot be read");
}

/* Wake-ups of so many seconds are added to @wakes. */
static void watch(struct wakes *wakes, struct incise_state *state, double seconds)
{
	struct incise_state_now *before = cli_alloc(1, sizeof(*before));
	struct incise_state_now *after = cli_alloc(1, sizeof(*after));

	state_read(state, before);
	pause_s(seconds);
	state_read(state, after);
	wakes->ticks += after->ticks - before->ticks;
	wakes->skipped += after->skipped - before->skipped;
	for (int i = 0; i < INCISE_STATE_BUCKETS; i++) {
		after->lateness.count[i] -= before->lateness.count[i];
		wakes->lateness.count[i] += after->lateness.count[i];
	}
	wakes->parts[wakes->n++] = incise_state_quantile(&after->lateness, 0.99) * 1e-3;
	free(before);
	free(after);
}

static void finish(struct wakes *wakes)
{
	wakes->p50 = incise_state_quantile(&wakes->lateness, 0.5) * 1e-3;
	wakes->p99 = incise_state_quantile(&wakes->lateness, 0.99) * 1e-3;
	wakes->p999 = incise_state_quantile(&wakes->lateness, 0.999) * 1e-3;
	harness_spread(wakes->parts, wakes->n, &wakes->spread);
}

/* In turns, so that a busy moment of the machine meets both. */
static void measure_loop(struct latency *row, struct wakes wakes[2], double seconds,
			 int rounds, bool realtime)
{
	char *path, *program = cli_text("%s/incise-haptic", cli_folder());
	char *argv[] = {program,
			"wall",
			"--rig",
			"sim:",
			"--state",
			NULL,
			realtime ? NULL : "--no-rt",
			NULL};
	double *us = cli_alloc(MESSAGES_MOST, sizeof(*us));
	struct reader client[CLIENTS];
	struct incise_state *state;
	struct server server;
	int n = 0;

	atexit(clean_up);
	folder_make(left.folder, sizeof(left.folder), "for a status file");
	path = cli_text("%s/wall.state", left.folder);
	argv[5] = path;
	left.loop = child_start(argv, -1, -1);
	state = state_open(path);
	wakes[0].name = "alone";
	wakes[1].name = "8 clients";
	for (int round = 0; round < rounds; round++) {
		cli_progress("loop with and without clients, round %d of %d", round + 1,
			     rounds);
		watch(&wakes[0], state, seconds);
		server = server_start((char *[]){path, NULL});
		for (int i = 0; i < CLIENTS; i++)
			reader_start(&client[i], connect_to(server.port), true,
				     i ? NULL : us + n);
		pause_s(0.5);
		atomic_store(&client[0].keep, true);
		watch(&wakes[1], state, seconds);
		for (int i = 0; i < CLIENTS; i++)
			reader_end(&client[i]);
		server_end(&server);
		n += client[0].n;
	}
	incise_state_close(state);
	clean_up();
	evaluate(row, "loop to client", us, n, rounds * seconds);
	finish(&wakes[0]);
	finish(&wakes[1]);
	free(path);
	free(program);
	free(us);
}

/* --- report -------------------------------------------------------------------------- */

static const struct bench_table latency_table = {
	.key = "rows",
	.row_bytes = sizeof(struct latency),
	.columns = {COLUMN(latency, "name", name), COLUMN(latency, "messages", messages),
		    COLUMN(latency, "rate_hz", hz), COLUMN(latency, "p50_us", p50),
		    COLUMN(latency, "p99_us", p99), COLUMN(latency, "p999_us", p999),
		    COLUMN(latency, "max_us", max)},
	.metrics = {METRIC(MEASURED, latency, spread, "us", "{name}: 99 %")},
};

static const struct bench_table wakes_table = {
	.key = "loop",
	.row_bytes = sizeof(struct wakes),
	.columns = {COLUMN(wakes, "name", name), COLUMN(wakes, "ticks", ticks),
		    COLUMN(wakes, "skipped", skipped), COLUMN(wakes, "p50_us", p50),
		    COLUMN(wakes, "p99_us", p99), COLUMN(wakes, "p999_us", p999)},
	.metrics = {METRIC(MEASURED, wakes, spread, "us", "wake-up, {name}: 99 %")},
};

static void run(struct bench_run *run)
{
	static struct latency latencies[3];
	static struct wakes wakes[2];
	double seconds = run->seconds > 0 ? run->seconds
			 : run->quick	  ? QUICK_SECONDS
					  : SECONDS;
	int rounds = run->quick ? QUICK_ROUNDS : ROUNDS;
	struct incise_realtime *granted = bench_realtime(INCISE_REALTIME_ANY_CPU);
	bool realtime = granted;

	cli_catch_signals();
	measure_rig(latencies, seconds * rounds);
	incise_realtime_free(granted);
	measure_loop(&latencies[2], wakes, seconds, rounds, realtime);
	cli_progress_end();
	bench_values(run, "{sf si si ss}", "seconds", seconds * rounds, "rate_hz",
		     RATE_HZ, "clients", CLIENTS, "policy", realtime ? "fifo" : "other");
	bench_rows(run, &latency_table, latencies, N(latencies));
	bench_rows(run, &wakes_table, wakes, N(wakes));
}

const struct bench bench_program = {
	.name = "serve",
	.summary = "time from a pose to a client of incise serve,\n"
		   "and wake-up latency of the loop meanwhile",
	.takes_duration = true,
	.run = run,
};
