/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Requests of PyTmcStepper 0.21.3 (PyPI) to a TMC2209 at node 0, over a pseudo terminal, each with the
 * answer that it accepted; recorded once. It begins datagrams with 55, as the upper four bits are free;
 * from the fifth on it was told to begin with 05. DRV_STATUS: the flags that it found.
 */
static const struct {
	const char *request, *answer;
} pytmcstepper[] = {
	/* Tmc2209() */
	{"55000208", "05ff02000000004c"},
	{"5500810000000723", ""},
	{"55000208", "05ff0200000001c5"},
	{"55000146", "05ff010000000013"},
	/* clear_gstat_verify() */
	{"0500028f", "05ff0200000001c5"},
	{"0500810000000770", ""},
	{"0500028f", "05ff02000000028b"},
	{"050001c1", "05ff010000000013"},
	/* test_com(): True */
	{"0500066f", "05ff06210000404f"},
	{"0500066f", "05ff06210000404f"},
	/* set_current_rms(600, 0.5, 8): 612 */
	{"05000048", "05ff00000001c1b2"},
	{"0500028f", "05ff02000000028b"},
	{"050080000001c0f6", ""},
	{"0500028f", "05ff020000000302"},
	{"05006cca", "05ff6c1000005351"},
	{"0500028f", "05ff020000000302"},
	{"0500ec100200531a", ""},
	{"0500028f", "05ff0200000004ac"},
	{"05001070", "05ff10000000009d"},
	{"0500028f", "05ff0200000004ac"},
	{"050090000813094e", ""},
	{"0500028f", "05ff020000000525"},
	{"05000048", "05ff00000001c03b"},
	{"0500028f", "05ff020000000525"},
	{"050080000001c0f6", ""},
	{"0500028f", "05ff02000000066b"},
	/* set_microstepping_resolution(16) */
	{"05006cca", "05ff6c10020053d7"},
	{"0500028f", "05ff02000000066b"},
	{"0500ec14020053d4", ""},
	{"0500028f", "05ff0200000007e2"},
	{"05000048", "05ff00000001c03b"},
	{"0500028f", "05ff0200000007e2"},
	{"050080000001c0f6", ""},
	{"0500028f", "05ff02000000083c"},
	/* set_interpolation(True) */
	{"05006cca", "05ff6c1402005319"},
	{"0500028f", "05ff02000000083c"},
	{"0500ec14020053d4", ""},
	{"0500028f", "05ff0200000009b5"},
	/* set_spreadcycle(False) */
	{"05000048", "05ff00000001c03b"},
	{"0500028f", "05ff0200000009b5"},
	{"050080000001c0f6", ""},
	{"0500028f", "05ff020000000afb"},
	/* set_tpwmthrs(500) */
	{"0500028f", "05ff020000000afb"},
	{"050093000001f474", ""},
	{"0500028f", "05ff020000000b72"},
	/* _set_coolstep_threshold(0x3a9) */
	{"05001490", "05ff1400000000f9"},
	{"0500028f", "05ff020000000b72"},
	{"050094000003a93b", ""},
	{"0500028f", "05ff020000000cdc"},
	/* _set_stallguard_threshold(75) */
	{"05004046", "05ff400000000040"},
	{"0500028f", "05ff020000000cdc"},
	{"0500c00000004bbd", ""},
	{"0500028f", "05ff020000000d55"},
	/* get_stallguard_result(): 300 */
	{"050041cf", "05ff410000012ced"},
	/* DRV_STATUS: otpw */
	{"05006f84", "05ff6f000000014f"},
	/* DRV_STATUS: ot */
	{"05006f84", "05ff6f0000000201"},
	/* DRV_STATUS: s2ga */
	{"05006f84", "05ff6f0000000426"},
	/* DRV_STATUS: s2gb */
	{"05006f84", "05ff6f00000008b6"},
	/* DRV_STATUS: s2vsa */
	{"05006f84", "05ff6f00000010fe"},
	/* DRV_STATUS: s2vsb */
	{"05006f84", "05ff6f00000020da"},
	/* DRV_STATUS: ola */
	{"05006f84", "05ff6f00000040c8"},
	/* DRV_STATUS: olb */
	{"05006f84", "05ff6f00000080c1"},
	/* DRV_STATUS: stealth */
	{"05006f84", "05ff6f40000000ea"},
	/* DRV_STATUS: stst */
	{"05006f84", "05ff6f80000000d0"},
	/* get_tstep(): 1048575 */
	{"050012b7", "05ff12000fffff1d"},
};
