// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Paper 2 as pictures; see demo_scene.h.
 */
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include "../cli/cli.h"
#include "demo.h"
#include "demo_scene.h"
#include "verb.h"

/* In the script of `incise view --procedure`: cut, bleeding, enlarging, tube. */
#define MOMENTS "2.4s,8.5s,12.2s,20s"
/* Near the cut, from a little beside and above. */
#define NEAR "18,40,150"

static void run(char *const *argv)
{
	struct incise_error err = {0};

	verb_say(argv);
	if (verb_run(argv, &err))
		cli_fail_with(&err);
}

void demo_scene(const char *scene, const char *folder, bool force)
{
	const char *slash = strrchr(scene, '/');
	char name[100], film[PATH_MAX], strip[PATH_MAX];

	snprintf(name, sizeof(name), "%s", slash ? slash + 1 : scene);
	if (strlen(name) > 6 && !strcmp(name + strlen(name) - 6, ".scene"))
		name[strlen(name) - 6] = 0;
	demo_make_folder(folder, force);
	snprintf(film, sizeof(film), "%s/%s.mkv", folder, name);
	snprintf(strip, sizeof(strip), "%s/%s.png", folder, name);
	run((char *const[]){"view", (char *)scene, "--procedure", "--video", film,
			    "--fps", "30", NULL});
	run((char *const[]){"view", (char *)scene, "--procedure", "--strip", strip,
			    "--at", MOMENTS, "--size", "640x480", "--no-panel",
			    "--camera", NEAR, "--fps", "10", NULL});
	printf("\n%s\n%s\n", film, strip);
	cli_finish();
}
