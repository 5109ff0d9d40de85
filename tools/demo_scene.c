// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Paper 2 as pictures; see demo_scene.h.
 */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include "cli.h"
#include "demo_scene.h"

/* In the script of `incise view --procedure`: cut, bleeding, enlarging, tube. */
#define MOMENTS "2.4s,8.5s,12.2s,20s"
/* Near the cut, from a little beside and above. */
#define NEAR "18,40,150"

static int run(char *const *argv)
{
	char program[PATH_MAX + 16];
	int status;
	pid_t child;

	snprintf(program, sizeof(program), "%s/incise-view", cli_folder());
	fputs("$ incise", stdout);
	for (char *const *arg = argv; *arg; arg++)
		printf(" %s", *arg);
	putchar('\n');
	fflush(stdout);
	child = fork();
	if (child < 0)
		cli_fail("fork: %s", strerror(errno));
	if (!child) {
		execv(program, argv);
		fprintf(stderr, "incise demo: %s: %s\n", program, strerror(errno));
		_exit(1);
	}
	while (waitpid(child, &status, 0) < 0 && errno == EINTR)
		;
	return status;
}

void demo_scene(const char *scene, const char *folder, bool force)
{
	const char *slash = strrchr(scene, '/');
	char name[100], film[PATH_MAX], strip[PATH_MAX];

	snprintf(name, sizeof(name), "%s", slash ? slash + 1 : scene);
	if (strlen(name) > 6 && !strcmp(name + strlen(name) - 6, ".scene"))
		name[strlen(name) - 6] = 0;
	if (mkdir(folder, 0777) && (errno != EEXIST || !force))
		cli_fail("%s: %s%s", folder, strerror(errno),
			 errno == EEXIST ? "; give another -o DIR, or --force" : "");
	snprintf(film, sizeof(film), "%s/%s.mkv", folder, name);
	snprintf(strip, sizeof(strip), "%s/%s.png", folder, name);
	if (run((char *const[]){"view", (char *)scene, "--procedure", "--video", film,
				"--fps", "30", NULL}) ||
	    run((char *const[]){"view", (char *)scene, "--procedure", "--strip", strip,
				"--at", MOMENTS, "--size", "640x480", "--no-panel",
				"--camera", NEAR, "--fps", "10", NULL}))
		cli_fail("'incise view' failed, see the line above");
	printf("\n%s\n%s\n", film, strip);
	cli_finish();
}
