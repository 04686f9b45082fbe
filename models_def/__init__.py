"""Design time, in torch: a lens and a network become a frozen PSF and a checkpoint.

    prescriptions/, plates/, recipes/   what a person edits (TOML)
    optics/                    lens, rays, spots, PSF, freezing
    sensors/                   the forward model and the front end, differentiable
    networks/                  the recovery networks
    training/                  samples, trainer, validation
    design/                    a lens and its network, designed together
    kinds/                     what each kind of camera brings to training
    face/                      `camkit.freeze` and `camkit.train`
    toml_table, torch_file     what people wrote, what torch wrote, checked
    model_faults               what pydantic finds in it, in words of camkit
    time_limit                 the limit of a run, which long preparation asks about
    torch_threads              work of many small steps on one thread

Design time calls the runtime where no gradient is needed; the runtime never imports design time.
"""
