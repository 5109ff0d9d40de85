// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/rig/stable_path.c, with files and links that stand for those in /dev. */
#include "../unit.h"
#include <fcntl.h>
#include "../../../lib/rig/stable_path.h"

static char home[] = "/tmp/incise-test-XXXXXX";

static int enter(void **state)
{
	static const char *const files[] = {"video0", "video1"};

	if (!mkdtemp(home) || chdir(home))
		return -1;
	for (int i = 0; i < 2; i++)
		close(open(files[i], O_CREAT | O_WRONLY, 0600));
	return symlink("video1", "id-b") || symlink("video0", "id-c") ||
	       symlink("video1", "id-d") || symlink("nothing", "id-a");
}

static int leave(void **state)
{
	char command[80];

	snprintf(command, sizeof(command), "rm -r %s", home);
	return chdir("/") || system(command);
}

TEST(the_first_link_that_leads_there)
{
	static const struct {
		const char *pattern, *path;
		size_t size;
		const char *link; /* NULL: none */
	} cases[] = {
		{"id-*", "video0", 16, "id-c"},
		{"id-*", "video1", 16, "id-b"},
		{"id-*", "id-d", 16, "id-b"},
		{"./id-*", "video1", 7, "./id-b"}, /* just room for it */
		{"./id-*", "video1", 6, NULL},
		{"other-*", "video0", 16, NULL},
		{"id-*", "video2", 16, NULL},
		{"id-a", "nothing", 16, NULL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char link[16] = "as it was";
		bool is = incise_stable_path(cases[i].pattern, cases[i].path, link,
					     cases[i].size);

		if (is != (cases[i].link != NULL) ||
		    strcmp(link, is ? cases[i].link : "as it was") != 0)
			fail_msg("case %zu: %d, %s", i, is, link);
	}
}

GROUP(enter, leave);
