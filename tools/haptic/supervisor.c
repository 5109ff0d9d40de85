// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The loop's thread, and the supervisor of a normal priority: log, state page, service manager,
 * watchdog, another scene at SIGHUP, another tool.
 *
 *   loop      tick tick tick tick …          (real time; no lock, no file, no log)
 *               │ control: events, ticks, plans        │ state page
 *   supervisor  └─▶ log, sd_notify, watchdog, reload   └─▶ incise status, incise view …
 *       ▲
 *       └── control socket, keys, foot switch: the tool
 */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#include <incise/export.h>
#include <incise/foot_switch.h>
#include <incise/tool.h>
#include "../cli/cli.h"
#include "../cli/loop_report.h"
#include "control.h"
#include "haptic.h"

/* --- keys on a terminal: b, h, t and a for blade, handle, tube and auto, without Enter ---- */

#define ESCAPE 27

/* Signals of a fault in the program. */
static const int keys_faults[] = {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGSYS, 0};

/* Others that end the program, and that incise haptic does not catch. */
static const int ends[] = {SIGABRT, SIGQUIT, SIGTRAP, SIGALRM,
			   SIGXCPU, SIGUSR1, SIGUSR2, 0};

static struct termios before;
static volatile sig_atomic_t changed;

/* Whether this process is in the foreground: else reading would stop it, and the loop with it. */
static bool keys_here(void)
{
	return tcgetpgrp(STDIN_FILENO) == getpgrp();
}

/* May be called again, and without keys_open(). */
static void keys_close(void)
{
	if (!changed)
		return;
	changed = 0;
	/* In the background the terminal is another program's. */
	if (keys_here())
		tcsetattr(STDIN_FILENO, TCSANOW, &before);
}

/* All that it calls is safe in a signal handler; POSIX.1-2008, 2.4.3. */
static void die(int number)
{
	keys_close();
	/* By the default action, which is in force again. */
	raise(number);
}

static void catch (const int *signals)
{
	struct sigaction action = {.sa_handler = die,
				   .sa_flags = SA_RESETHAND | SA_NODEFER};

	for (; *signals; signals++)
		sigaction(*signals, &action, NULL);
}

/*
 * Read keys one by one, if standard input is the terminal of this process in the foreground: it is
 * as before again after keys_close(), at exit(3), and after a signal that kills, but for SIGKILL.
 */
static bool keys_open(void)
{
	struct sigaction ignore = {.sa_handler = SIG_IGN};
	struct termios now;

	if (!isatty(STDIN_FILENO) || !keys_here() || tcgetattr(STDIN_FILENO, &before))
		return false;
	/* Put into the background between a look and a read, it gets an error. */
	sigaction(SIGTTIN, &ignore, NULL);
	sigaction(SIGTTOU, &ignore, NULL);
	catch (keys_faults);
	catch (ends);
	atexit(keys_close);
	now = before;
	/* Ctrl-C and Ctrl-Z keep their effect. */
	now.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
	now.c_cc[VMIN] = 1;
	now.c_cc[VTIME] = 0;
	changed = 1;
	return !tcsetattr(STDIN_FILENO, TCSANOW, &now);
}

/* The tool of the key that was pressed, enum incise_tool; -1: no tool's key. */
static int keys_read(void)
{
	char key[32];
	ssize_t n = read(STDIN_FILENO, key, sizeof(key));

	/* An arrow or the like begins with it, and is sent at once. The last key counts. */
	if (n <= 0 || key[0] == ESCAPE)
		return -1;
	switch (key[n - 1]) {
	case 'a':
		return INCISE_TOOL_AUTO;
	case 'b':
		return INCISE_TOOL_BLADE;
	case 'h':
		return INCISE_TOOL_HANDLE;
	case 't':
		return INCISE_TOOL_TUBE;
	default:
		return -1;
	}
}

/*
 * --- the service manager ---------------------------------------------------------------
 *
 * The protocol of sd_notify(3): a datagram of lines VARIABLE=VALUE to the socket in
 * $NOTIFY_SOCKET. libsystemd would bring a megabyte of libraries into a process that is locked
 * in memory.
 */

/* The socket's address; 0: not set, or invalid. */
static socklen_t address(struct sockaddr_un *to)
{
	const char *path = getenv("NOTIFY_SOCKET");
	size_t length = path ? strlen(path) : 0;

	if (!length || length >= sizeof(to->sun_path) || (*path != '/' && *path != '@'))
		return 0;
	*to = (struct sockaddr_un){.sun_family = AF_UNIX};
	memcpy(to->sun_path, path, length);
	/* An abstract socket: its name starts with a 0. */
	if (*path == '@')
		to->sun_path[0] = 0;
	return (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
}

/* Send lines, for example "READY=1\nSTATUS=runs". Never waits; a failed send is lost. */
static void notify_send(const char *fmt, ...) INCISE_PRINTF(1, 2);
static void notify_send(const char *fmt, ...)
{
	struct sockaddr_un to;
	socklen_t size = address(&to);
	char text[1024];
	va_list args;
	int length, fd;

	if (!size)
		return;
	va_start(args, fmt);
	length = vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	if (fd < 0)
		return;
	if (length >= (int)sizeof(text))
		length = sizeof(text) - 1;
	if (length > 0)
		sendto(fd, text, (size_t)length, MSG_NOSIGNAL | MSG_DONTWAIT,
		       (struct sockaddr *)&to, size);
	close(fd);
}

/* "RELOADING=1", with the time that the protocol requires. */
static void notify_reloading(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	notify_send("RELOADING=1\nMONOTONIC_USEC=%lld",
		    now.tv_sec * 1000000LL + now.tv_nsec / 1000);
}

/* Longest time between WATCHDOG=1 of this process; 0: no watchdog. */
static int64_t notify_watchdog_ns(void)
{
	const char *us = getenv("WATCHDOG_USEC"), *pid = getenv("WATCHDOG_PID");
	long long value = us ? strtoll(us, NULL, 10) : 0;

	/* Inherited from a parent. */
	if (pid && strtoll(pid, NULL, 10) != getpid())
		return 0;
	return value > 0 && value < INT64_MAX / 1000 ? value * 1000 : 0;
}

/* --- the supervisor -------------------------------------------------------------------- */

#define LOOK_MS 100
#define KEPT_S 4 /* of ticks that wait for the session: 17 MB at 20 kHz */
#define REPORT_NS INCISE_NS_PER_S
#define FOOT_NS INCISE_NS_PER_S /* between tries to open the foot switch */

static volatile sig_atomic_t reload_asked;

/* Shared by the loop's thread and its supervisor until the thread is joined. */
struct supervisor {
	struct haptic *haptic;
	struct incise_clock *time; /* of the log; the rig's may be simulated */
	pthread_t thread;
	int ended_fd; /* readable when the loop has ended */
	_Atomic int tid;
	int rc;
	struct incise_error err;

	/* A scene that the loop has not yet taken. */
	struct incise_scene *next_scene;
	struct incise_plan *next_plan;

	struct control *control;	 /* or NULL */
	bool keys;			 /* are read from the terminal */
	struct incise_foot_switch *foot; /* or NULL */
	bool has_foot, foot_missed;	 /* the rig has one; which is not there */
	int64_t foot_ns;		 /* next try to open it */

	bool ready, stopping;
	uint64_t fed_ticks; /* when the watchdog was last fed */
	uint64_t reported_ticks;
	uint64_t overruns, skipped; /* since the last line of the log */
	uint64_t overruns_all, skipped_all;
	bool stale;
	bool flags_reported[256]; /* of poses */
	char refused[530];	  /* reason of the last refused reload, or "" */
	int64_t look_ns, report_ns, feed_ns, watchdog_ns;
};

/* --- the loop's thread ------------------------------------------------------------------ */

static void take_counts(struct incise_realtime_counts *counts, int sign)
{
	struct rusage usage;

	getrusage(RUSAGE_THREAD, &usage);
	counts->minor_faults += (uint64_t)(sign * usage.ru_minflt);
	counts->major_faults += (uint64_t)(sign * usage.ru_majflt);
	counts->voluntary += (uint64_t)(sign * usage.ru_nvcsw);
	counts->involuntary += (uint64_t)(sign * usage.ru_nivcsw);
}

static void *run_loop(void *argument)
{
	struct supervisor *s = argument;
	struct haptic *haptic = s->haptic;
	uint64_t one = 1;

	s->tid = gettid();
	if (haptic->realtime)
		s->rc = incise_realtime_enter(haptic->realtime, &s->err);
	if (!s->rc) {
		take_counts(&haptic->counts, -1);
		s->rc = incise_loop_run(haptic->plan, incise_rig_clock(haptic->rig),
					&haptic->loop, haptic->stats, &s->err);
		take_counts(&haptic->counts, 1);
	}
	if (write(s->ended_fd, &one, sizeof(one)) < 0)
		abort();
	return NULL;
}

static int start_supervisor_thread(struct supervisor *s, struct incise_error *err)
{
	sigset_t all, before;
	int rc;

	/*
	 * The supervisor handles signals: in the loop they would make ticks late. It cannot take
	 * signals of a fault: blocked, they kill without a handler, which restores the terminal.
	 */
	sigfillset(&all);
	for (const int *fault = keys_faults; *fault; fault++)
		sigdelset(&all, *fault);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	rc = pthread_create(&s->thread, NULL, run_loop, s);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	return rc ? incise_error_set(err, rc, "the loop's thread: %s", strerror(rc)) : 0;
}

/* --- another scene ---------------------------------------------------------------------- */

static void on_reload(int number)
{
	(void)number;
	reload_asked = 1;
}

void haptic_catch_reload(void)
{
	struct sigaction action = {.sa_handler = on_reload};
	int terminal = open("/dev/tty", O_RDONLY | O_CLOEXEC | O_NOCTTY);

	if (terminal >= 0)
		close(terminal);
	else
		sigaction(SIGHUP, &action, NULL);
}

struct incise_plan *haptic_plan(const struct haptic *haptic,
				const struct incise_scene *scene,
				struct incise_error *err)
{
	struct incise_rig *rig = haptic->mode == HAPTIC_WATCH ? NULL : haptic->rig;
	struct incise_plan *plan = incise_plan_new(scene, rig, err);

	if (plan) {
		incise_plan_set_tool(plan, haptic->tool);
		incise_plan_set_tip(plan, haptic->calibration.values.tip_mm);
	}
	return plan;
}

static void free_next(struct supervisor *s)
{
	incise_plan_free(s->next_plan);
	incise_scene_free(s->next_scene);
	s->next_plan = NULL;
	s->next_scene = NULL;
}

static int prepare_next(struct supervisor *s, struct incise_error *err)
{
	struct haptic *haptic = s->haptic;
	struct self_test test;
	double rate_hz;
	int rc;

	if (haptic->session || haptic->loop.ticked)
		return incise_error_set(
			err, EBUSY,
			"a session and --procedure keep their scene; end this run, and "
			"start another with the changed scene");
	if (haptic->mode != HAPTIC_LOOP)
		return incise_error_set(
			err, EBUSY,
			"the kernel keeps its plan while its actuators have power; end "
			"incise feed, and start it again");
	s->next_scene = scene_argument_read(&haptic->argument, err);
	if (!s->next_scene)
		return -errno;
	rate_hz = incise_scene_rate_hz(s->next_scene);
	if (rate_hz != haptic->loop.rate_hz)
		return incise_error_set(err, EINVAL,
					"%s: rate_hz is %g, but the loop runs at %g "
					"Hz; restart it",
					haptic->argument.path, rate_hz,
					haptic->loop.rate_hz);
	rc = haptic_self_test(s->next_scene, incise_rig_tracker(haptic->rig), &test, err);
	if (rc)
		return rc;
	s->next_plan = haptic_plan(haptic, s->next_scene, err);
	return s->next_plan ? 0 : -errno;
}

static void start_reload(struct supervisor *s)
{
	struct incise_error err = {0};
	int rc = 0;

	reload_asked = 0;
	/* One at a time; a later request is kept. */
	if (s->next_plan || s->stopping) {
		reload_asked = !s->stopping;
		return;
	}
	notify_reloading();
	incise_state_run(s->haptic->state, INCISE_RUN_RELOADING, "");
	rc = prepare_next(s, &err);
	if (!rc)
		rc = incise_loop_control_offer(s->haptic->loop.control, s->next_plan);
	if (!rc)
		return;
	free_next(s);
	incise_state_run(s->haptic->state, INCISE_RUN_RUNNING, "");
	incise_state_refused(s->haptic->state, err.text);
	cli_warn("not reloaded, the previous scene continues: %s", err.text);
	snprintf(s->refused, sizeof(s->refused), "; not reloaded: %s", err.text);
	notify_send("READY=1");
}

static void end_reload(struct supervisor *s)
{
	struct haptic *haptic = s->haptic;
	struct incise_plan *old = incise_loop_control_retired(haptic->loop.control);

	if (!old)
		return;
	incise_plan_free(old);
	incise_scene_free(haptic->scene);
	haptic->plan = s->next_plan;
	haptic->scene = s->next_scene;
	s->next_plan = NULL;
	s->next_scene = NULL;
	incise_state_scene(haptic->state, haptic->argument.path, haptic->plan);
	incise_state_run(s->haptic->state, INCISE_RUN_RUNNING, "");
	s->refused[0] = 0;
	cli_note("%s: reloaded", haptic->argument.path);
	notify_send("READY=1");
}

/* --- the tool ---------------------------------------------------------------------------- */

/* The reason why the scene has only the blade; NULL: it has every tool. */
static const char *only_blade(const struct haptic *haptic)
{
	const char *why = NULL, *stage;

	for (int i = 0; (stage = incise_plan_left_out(haptic->plan, i, &why)); i++)
		if (!strcmp(stage, "tool"))
			return why;
	return NULL;
}

/* Returns the reason why not; NULL: the loop takes it at its next tick. */
static const char *order_tool(struct supervisor *s, enum incise_tool tool)
{
	static struct incise_error err;
	const char *why = only_blade(s->haptic);

	if (why && tool != INCISE_TOOL_AUTO && tool != INCISE_TOOL_BLADE)
		return why;
	if (s->haptic->mode == HAPTIC_WATCH &&
	    feeder_tool(&s->haptic->feeder, loop_tool_names[tool], &err))
		return err.text;
	/* For a plan that is read later, too. */
	s->haptic->tool = tool;
	incise_loop_control_set_tool(s->haptic->loop.control, tool);
	return NULL;
}

/* "tool", or "tool NAME". */
static void answer_supervisor_request(void *context, const char *request,
				      char reply[CONTROL_LINE])
{
	struct supervisor *s = context;
	const char *name = request + strlen("tool"), *why = NULL;
	int tool = 0;

	if (strncmp(request, "tool", strlen("tool")) || (*name && *name != ' ')) {
		snprintf(
			reply, CONTROL_LINE,
			"error unknown request; expected: tool [blade|handle|tube|auto]");
		return;
	}
	while (*name && loop_tool_names[tool] && strcmp(name + 1, loop_tool_names[tool]))
		tool++;
	if (!loop_tool_names[tool]) {
		snprintf(reply, CONTROL_LINE,
			 "error unknown tool; expected blade, handle, tube or auto");
		return;
	}
	if (*name)
		why = order_tool(s, (enum incise_tool)tool);
	if (why)
		snprintf(reply, CONTROL_LINE, "error the scene has only the blade: %s",
			 why);
	else
		snprintf(reply, CONTROL_LINE, "ok held=%s wanted=%s",
			 loop_tool_names[incise_loop_control_tool(
				 s->haptic->loop.control)],
			 loop_tool_names[s->haptic->tool]);
}

static void take_key(struct supervisor *s)
{
	int tool = keys_read();
	const char *why;

	if (tool < 0)
		return;
	why = order_tool(s, (enum incise_tool)tool);
	if (why) {
		cli_warn("the scene has only the blade: %s", why);
		return;
	}
	cli_progress_end();
	fprintf(stderr, "tool: %s\n", loop_tool_names[tool]);
}

/* Warn once; from then on it is looked for. */
static void miss_foot(struct supervisor *s, const char *why)
{
	incise_foot_switch_close(s->foot);
	s->foot = NULL;
	if (!s->foot_missed)
		cli_warn("foot switch disconnected: %s", why);
	s->foot_missed = true;
}

static void look_for_foot(struct supervisor *s, int64_t now_ns)
{
	struct incise_foot_switch_setup setup;
	struct incise_error err = {0};

	if (!s->has_foot || s->foot || now_ns < s->foot_ns)
		return;
	s->foot_ns = now_ns + FOOT_NS;
	incise_rig_foot_switch(s->haptic->rig, &setup);
	s->foot = incise_foot_switch_open(&setup, &err);
	if (!s->foot) {
		miss_foot(s, err.text);
		return;
	}
	cli_note("foot switch: %s%s", setup.device, s->foot_missed ? " is back" : "");
	s->foot_missed = false;
}

/* Each press: the tube, or auto again. */
static void take_foot(struct supervisor *s)
{
	int presses = incise_foot_switch_read(s->foot);
	const char *why;

	if (presses < 0)
		miss_foot(s, strerror(-presses));
	if (presses <= 0 || presses % 2 == 0)
		return;
	why = order_tool(s, s->haptic->tool == INCISE_TOOL_TUBE ? INCISE_TOOL_AUTO
								: INCISE_TOOL_TUBE);
	if (why)
		cli_warn("the scene has only the blade: %s", why);
	else
		cli_note("foot switch: %s", loop_tool_names[s->haptic->tool]);
}

/* --- log and status --------------------------------------------------------------------- */

/* Once for each flag: a tracker may set one and take it back many times a second. */
static void report_flag(struct supervisor *s, char flag)
{
	bool *reported = &s->flags_reported[(unsigned char)flag];

	if (!*reported)
		cli_warn("the tracker flags poses '%c': %s; %s",
			 flag > ' ' && flag <= '~' ? flag : '?', incise_pose_flag(flag),
			 incise_pose_usable(flag)
				 ? "they are used"
				 : "they are not used, and the force ramps to zero");
	*reported = true;
}

static void handle_events(struct supervisor *s)
{
	struct incise_loop_event events[32];
	int n;

	while ((n = incise_loop_control_events(s->haptic->loop.control, events, 32)) > 0)
		for (int i = 0; i < n; i++)
			switch (events[i].kind) {
			case INCISE_LOOP_OVERRUN:
				s->overruns++;
				s->skipped += (uint64_t)events[i].value;
				break;
			case INCISE_LOOP_STALE:
				s->stale = true;
				/* At the start the first pose is still to come. */
				if (events[i].tick)
					cli_note("no fresh pose: the force ramps to "
						 "zero");
				break;
			case INCISE_LOOP_FRESH:
				s->stale = false;
				if (events[i].value > 100)
					cli_note("poses arrive again, after %.0f ms",
						 events[i].value);
				break;
			case INCISE_LOOP_NOT_FINITE:
				cli_warn("the force was not a number: 0 was commanded");
				break;
			case INCISE_LOOP_FLAGGED:
				report_flag(s, (char)events[i].value);
				break;
			case INCISE_LOOP_TOOL:
				cli_note("the hand holds the %s",
					 loop_tool_names[(int)events[i].value]);
				break;
			case INCISE_LOOP_HAPTIC:
				cli_note(
					"force %s",
					incise_haptic_off_text(
						(enum incise_haptic_off)events[i].value));
				break;
			case INCISE_LOOP_PLAN:
				break;
			}
}

/* Ticks for the session; in simulated time the loop's thread gives them itself. */
static void take_session(struct supervisor *s)
{
	struct incise_tick ticks[128];
	uint64_t lost = 0;
	int n;

	if (!s->haptic->session || s->haptic->loop.ticked)
		return;
	do {
		n = incise_loop_control_take(s->haptic->loop.control, ticks, 128, &lost);
		for (int i = 0; i < n; i++)
			session_log_tick(s->haptic->session, &ticks[i]);
	} while (n == 128);
	session_log_lost(s->haptic->session, lost);
}

/* Once a second: overruns since the last line, and the rate. */
static void report_supervisor(struct supervisor *s, uint64_t ticks, int64_t now_ns)
{
	struct haptic *haptic = s->haptic;
	struct incise_realtime_counts counts;
	double seconds = (double)(now_ns - s->report_ns + REPORT_NS) / INCISE_NS_PER_S;
	double rate_hz = (double)(ticks - s->reported_ticks) / seconds;
	char text[200];

	s->overruns_all += s->overruns;
	s->skipped_all += s->skipped;
	if (s->overruns)
		cli_note("%llu overruns, %llu ticks missed",
			 (unsigned long long)s->overruns, (unsigned long long)s->skipped);
	s->overruns = s->skipped = 0;
	if (s->tid && !incise_realtime_count(s->tid, &counts))
		incise_state_counts(haptic->state, &counts);
	snprintf(text, sizeof(text), "%.0f of %g Hz, %llu overruns, %llu ticks missed%s",
		 rate_hz, haptic->loop.rate_hz, (unsigned long long)s->overruns_all,
		 (unsigned long long)s->skipped_all, s->stale ? ", no fresh pose" : "");
	notify_send("STATUS=%s%s", text, s->refused);
	cli_progress("%s: %s; Ctrl-C ends", haptic->argument.path, text);
	s->reported_ticks = ticks;
}

static void look_supervisor(struct supervisor *s)
{
	struct haptic *haptic = s->haptic;
	uint64_t ticks = incise_loop_control_ticks(haptic->loop.control);
	int64_t now_ns = incise_clock_now(s->time);

	handle_events(s);
	take_session(s);
	if (!s->ready && ticks) {
		s->ready = true;
		incise_state_run(s->haptic->state, INCISE_RUN_RUNNING, "");
		notify_send("READY=1\nSTATUS=runs at %g Hz", haptic->loop.rate_hz);
		cli_note("%s: runs at %g Hz, %s", haptic->argument.path,
			 haptic->loop.rate_hz, haptic->scheduling);
	}
	/* Only while ticks come: the manager ends a loop that hangs. */
	if (s->watchdog_ns && now_ns >= s->feed_ns && ticks != s->fed_ticks) {
		notify_send("WATCHDOG=1");
		s->fed_ticks = ticks;
		s->feed_ns = now_ns + s->watchdog_ns / 4;
	}
	if (cli_stop && !s->stopping) {
		s->stopping = true;
		/* A second signal kills. */
		keys_close();
		s->keys = false;
		incise_state_run(s->haptic->state, INCISE_RUN_STOPPING,
				 strsignal(cli_stop));
		notify_send("STOPPING=1\n"
			    "STATUS=the force ramps to zero");
		cli_note("%s: the force ramps to zero", strsignal(cli_stop));
	}
	look_for_foot(s, now_ns);
	end_reload(s);
	if (reload_asked && s->ready)
		start_reload(s);
	if (now_ns >= s->report_ns) {
		report_supervisor(s, ticks, now_ns);
		s->report_ns = now_ns + REPORT_NS;
	}
}

/* The loop has ended: drop a plan that it did not take. */
static void settle(struct supervisor *s)
{
	handle_events(s);
	take_session(s);
	end_reload(s);
	if (s->next_plan)
		incise_loop_control_withdraw(s->haptic->loop.control);
	free_next(s);
}

/*
 * Wait for the loop's end, an order, or the time to look. Orders come in between, and however many
 * there are, look() goes on. Returns false when the loop has ended.
 */
static bool wait_for_orders(struct supervisor *s)
{
	struct pollfd polled[3 + CONTROL_POLLED] = {
		{.fd = s->ended_fd, .events = POLLIN},
		/* A negative one is passed over. */
		{.fd = s->keys && keys_here() ? STDIN_FILENO : -1, .events = POLLIN},
		{.fd = s->foot ? incise_foot_switch_fd(s->foot) : -1, .events = POLLIN},
	};
	int n = 3, clients = 0, ready;

	if (s->control)
		clients = control_polled(s->control, polled + n);
	ready = poll(polled, (nfds_t)(n + clients), LOOK_MS);
	if (ready > 0 && polled[0].revents)
		return false;
	if (ready > 0 && s->control)
		control_serve(s->control, polled + n, answer_supervisor_request, s);
	if (ready > 0 && polled[1].revents)
		take_key(s);
	if (ready > 0 && polled[2].revents)
		take_foot(s);
	if (ready <= 0 || incise_clock_now(s->time) >= s->look_ns) {
		look_supervisor(s);
		s->look_ns = incise_clock_now(s->time) + LOOK_MS * 1000000LL;
	}
	return true;
}

static void open_orders(struct supervisor *s)
{
	struct incise_foot_switch_setup setup;
	struct incise_error err = {0};

	s->keys = keys_open();
	/* The feeder reads it. */
	s->has_foot = s->haptic->mode != HAPTIC_WATCH &&
		      !incise_rig_foot_switch(s->haptic->rig, &setup);
	if (!s->haptic->page)
		return;
	s->control = control_new(s->haptic->page, &err);
	if (!s->control)
		cli_warn("no control socket: %s", err.text);
}

static void close_orders(struct supervisor *s)
{
	keys_close();
	incise_foot_switch_close(s->foot);
	control_free(s->control);
}

static int supervise(struct supervisor *s, struct incise_error *err)
{
	int rc = start_supervisor_thread(s, err);

	if (rc)
		return rc;
	open_orders(s);
	while (wait_for_orders(s))
		continue;
	close_orders(s);
	pthread_join(s->thread, NULL);
	settle(s);
	if (s->rc)
		*err = s->err;
	return s->rc;
}

/* Room for the longest time that the supervisor is at other work. 0 or -1 with errno. */
static int keep_ticks(const struct haptic *haptic)
{
	int rc = 0;

	if (haptic->session && !haptic->loop.ticked)
		rc = incise_loop_control_keep(haptic->loop.control,
					      (size_t)(haptic->loop.rate_hz * KEPT_S));
	errno = -rc;
	return rc ? -1 : 0;
}

int haptic_supervise(struct haptic *haptic, struct incise_error *err)
{
	struct supervisor s = {.haptic = haptic,
			       .ended_fd = eventfd(0, EFD_CLOEXEC),
			       .time = incise_clock_new_real(),
			       .watchdog_ns = notify_watchdog_ns()};
	int rc;

	haptic->loop.control = incise_loop_control_new();
	if (!haptic->loop.control || !s.time || s.ended_fd < 0 || keep_ticks(haptic)) {
		rc = incise_error_set(err, errno, "the loop cannot be supervised: %s",
				      strerror(errno));
	} else {
		s.report_ns = incise_clock_now(s.time) + REPORT_NS;
		rc = supervise(&s, err);
	}
	if (s.ended_fd >= 0)
		close(s.ended_fd);
	incise_clock_free(s.time);
	incise_loop_control_free(haptic->loop.control);
	haptic->loop.control = NULL;
	return rc;
}
