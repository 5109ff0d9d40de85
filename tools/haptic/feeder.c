// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The feeder of a scene that the kernel renders; see feeder.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <incise/clock.h>
#include <incise/state.h>
#include "../cli/cli.h"
#include "control.h"
#include "feeder.h"

#define LOOK_NS 20000000

/* Homing takes its time; a device that hangs does not take longer. */
#define START_MOST_S 60

/* Timeout of a question for its tool: less than the watchdog of the watcher. */
#define ANSWER_MS 300

/* Fade, and the way back of the nuts; then it is killed, and the module lets the force fade. */
#define END_MOST_S 10

char *feeder_page(const char *loop_page)
{
	size_t n = strlen(loop_page);

	n -= cli_ends_with(loop_page, ".state") ? strlen(".state") : 0;
	return cli_text("%.*s.feed.state", (int)n, loop_page);
}

/* Whether a feeder with that page lives and runs; *pid is its own, *of its scene and rig. */
static bool feeder_lives(const char *page, pid_t *pid, char **of)
{
	struct incise_error err = {0};
	struct incise_state *state = incise_state_open(page, &err);
	struct incise_state_now *now = cli_alloc(1, sizeof(*now));
	bool lives = state && !incise_state_read(state, now) && now->alive &&
		     now->run == INCISE_RUN_RUNNING;

	*pid = lives ? (pid_t)now->pid : 0;
	if (of)
		*of = lives ? cli_text("%s on %s", now->scene, now->rig) : NULL;
	free(now);
	incise_state_close(state);
	return lives;
}

/* A session of its own: neither a Ctrl-C nor the end of this process is for it. */
static pid_t start_feeder(char **argv)
{
	pid_t pid = fork();
	int null;

	if (pid)
		return pid;
	setsid();
	null = open("/dev/null", O_RDWR | O_CLOEXEC);
	if (null >= 0) {
		dup2(null, STDIN_FILENO);
		dup2(null, STDOUT_FILENO);
	}
	execv(argv[0], argv);
	_exit(127);
}

static int await(struct feeder *feeder, struct incise_error *err)
{
	const struct timespec pause = {.tv_nsec = LOOK_NS};
	int64_t looks = START_MOST_S * (INCISE_NS_PER_S / LOOK_NS);
	int status;
	pid_t pid;

	while (!feeder_lives(feeder->page, &pid, NULL) || pid != feeder->pid) {
		if (waitpid(feeder->pid, &status, WNOHANG) == feeder->pid) {
			feeder->own = false;
			return incise_error_set(err, ECHILD,
						"incise feed ended before it sent a "
						"pose");
		}
		if (!looks--) {
			feeder_end(feeder);
			return incise_error_set(err, ETIME,
						"incise feed sent no pose within %d s",
						START_MOST_S);
		}
		if (cli_stop) {
			feeder_end(feeder);
			return incise_error_set(err, EINTR, "%s", strsignal(cli_stop));
		}
		nanosleep(&pause, NULL);
	}
	return 0;
}

int feeder_begin(struct feeder *feeder, char **argv, struct incise_error *err)
{
	char *of;
	int rc;

	if (feeder_lives(feeder->page, &feeder->pid, &of)) {
		cli_warn("incise feed already runs, process %d, with %s: it continues "
			 "when this program ends; 'kill %d' ends it",
			 (int)feeder->pid, of, (int)feeder->pid);
		free(of);
		return 0;
	}
	/* A feeder of a service would end with it. */
	if (getenv("NOTIFY_SOCKET"))
		return incise_error_set(err, ESRCH,
					"a service does not start incise feed; start "
					"incise-feed@.service of that scene");
	argv[0] = cli_text("%s/incise-feed", cli_folder());
	feeder->pid = start_feeder(argv);
	feeder->own = true;
	rc = feeder->pid < 0
		     ? incise_error_set(err, errno, "%s: %s", argv[0], strerror(errno))
		     : await(feeder, err);
	free(argv[0]);
	return rc;
}

int feeder_tool(const struct feeder *feeder, const char *tool, struct incise_error *err)
{
	char *path = control_path(feeder->page), *request = cli_text("tool %s", tool);
	char reply[CONTROL_LINE];
	int rc = control_ask(path, request, ANSWER_MS, reply);

	if (rc)
		rc = incise_error_set(err, -rc, "the feeder does not answer: %s",
				      strerror(-rc));
	else if (!strncmp(reply, "error ", strlen("error ")))
		rc = incise_error_set(err, EINVAL, "%s", reply + strlen("error "));
	free(request);
	free(path);
	return rc;
}

int feeder_end(struct feeder *feeder)
{
	const struct timespec pause = {.tv_nsec = LOOK_NS};
	int64_t looks = END_MOST_S * (INCISE_NS_PER_S / LOOK_NS);

	int status = 0;

	if (!feeder->own || feeder->pid <= 0)
		return 0;
	feeder->own = false;
	kill(feeder->pid, SIGTERM);
	/* A stopped feeder ends as well. */
	kill(feeder->pid, SIGCONT);
	while (waitpid(feeder->pid, &status, WNOHANG) == 0) {
		if (!looks--)
			kill(feeder->pid, SIGKILL);
		nanosleep(&pause, NULL);
	}
	return status ? -ECHILD : 0;
}
