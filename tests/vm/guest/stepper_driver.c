// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A TMC2209 on a pseudo terminal, whose path it prints; it is hot while there is a file /run/hot.
 *
 *   stepper_driver >PATH
 */
#include <stdint.h>
#include <stdio.h>
#include "../../unit/tmc/chip.h"

static struct chip_line line;

static void look(struct chip_line *l)
{
	l->reg[0][CHIP_DRV_STATUS] = access("/run/hot", F_OK) ? 0xc0000000 : 3;
}

int main(void)
{
	line.before_read = look;
	if (chip_begin(&line))
		return 1;
	puts(line.path);
	fclose(stdout);
	for (;;)
		pause();
}
