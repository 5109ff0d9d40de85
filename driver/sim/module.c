// SPDX-License-Identifier: GPL-2.0-only
/*
 * incise_sim: a GPIO chip and an ADC that exist in memory only, for the tests
 * of incise. Never load it on a machine that does something.
 *
 * One platform device, made by the module itself. Its memory lives as long as
 * the module, so that a consumer that is late does no harm after an unbind.
 */
#include <linux/module.h>
#include <linux/platform_device.h>

#include "../compat.h"
#include "adc.h"
#include "sim.h"

static unsigned int lines = 64;
module_param(lines, uint, 0444);
MODULE_PARM_DESC(lines, "Number of GPIO lines, 1 to 256");

static unsigned int ring = 1U << 20;
module_param(ring, uint, 0444);
MODULE_PARM_DESC(ring, "Number of edges kept for a reader, up to 2^24");

static struct sim sim_instance;
static struct sim_adc sim_adc_instance;
static struct platform_device *sim_device;

static int sim_probe(struct platform_device *device)
{
	struct sim *sim = &sim_instance;
	int ret;

	ret = sim_chip_add(sim, &device->dev);
	if (ret)
		return ret;
	ret = sim_adc_add(&sim_adc_instance, &device->dev);
	if (ret) {
		sim_chip_remove(sim);
		return ret;
	}
	platform_set_drvdata(device, sim);
	sim->dir = debugfs_create_dir("incise_sim", NULL);
	sim_edges_files(sim);
	sim_carriage_files(sim);
	sim_inputs_files(sim);
	sim_faults_files(sim);
	sim_adc_files(&sim_adc_instance, sim->dir);
	return 0;
}

static void sim_remove(struct platform_device *device)
{
	struct sim *sim = platform_get_drvdata(device);

	debugfs_remove_recursive(sim->dir);
	sim_adc_remove(&sim_adc_instance);
	sim_chip_remove(sim);
}

COMPAT_PLATFORM_REMOVE(sim_remove)

static struct platform_driver sim_driver = {
	.probe = sim_probe,
	.remove = compat_platform_remove(sim_remove),
	.driver = {.name = INCISE_SIM_LABEL},
};

static int __init sim_init(void)
{
	struct sim *sim = &sim_instance;
	int ret;

	if (!lines || lines > INCISE_SIM_LINES_MAX)
		return -EINVAL;
	raw_spin_lock_init(&sim->lock);
	sim->lines = lines;
	ret = sim_edges_init(sim, ring);
	if (ret)
		return ret;
	ret = sim_adc_init(&sim_adc_instance);
	if (ret)
		goto out_free_edges;
	ret = platform_driver_register(&sim_driver);
	if (ret)
		goto out_free_adc;
	sim_device = platform_device_register_simple(INCISE_SIM_LABEL,
						     PLATFORM_DEVID_NONE, NULL, 0);
	if (IS_ERR(sim_device)) {
		ret = PTR_ERR(sim_device);
		goto out_unregister_driver;
	}
	return 0;

out_unregister_driver:
	platform_driver_unregister(&sim_driver);
out_free_adc:
	sim_adc_free(&sim_adc_instance);
out_free_edges:
	sim_edges_free(sim);
	return ret;
}
module_init(sim_init);

static void __exit sim_exit(void)
{
	platform_device_unregister(sim_device);
	platform_driver_unregister(&sim_driver);
	sim_adc_free(&sim_adc_instance);
	sim_edges_free(&sim_instance);
}
module_exit(sim_exit);

MODULE_DESCRIPTION("Simulated GPIO chip and ADC for the tests of incise");
MODULE_AUTHOR("The incise authors");
MODULE_LICENSE("GPL");
