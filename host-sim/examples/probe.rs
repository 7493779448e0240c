use host_sim::full_memory::FullMemory;
use springpot::*;
fn rms(a:&[f64],b:&[f64])->f64{let n=b.len() as f64;let m=b.iter().sum::<f64>()/n;let v=b.iter().map(|x|(x-m).powi(2)).sum::<f64>()/n;let e=a.iter().zip(b).map(|(x,y)|(x-y).powi(2)).sum::<f64>()/n;(e/v).sqrt()}
fn main(){
  let sp=Springpot::new;
  let mut seed=1u64; let mut rnd=||{seed^=seed<<13;seed^=seed>>7;seed^=seed<<17;(seed>>11) as f64/(1u64<<53) as f64};
  let mut models=vec![
    ("n1",Maxwell::new(sp(62952.,0.2),&[[sp(36.,0.002),sp(142.,1.)]],Topology::Eq11,0.316).unwrap()),
    ("n2",Maxwell::new(sp(62740.,0.2),&[[sp(47958.,1.),sp(173210.,1.)],[sp(430381.,0.523),sp(215.,0.046)]],Topology::Eq11,0.316).unwrap()),
    ("n2p",Maxwell::new(sp(62740.,0.2),&[[sp(47958.,1.),sp(173210.,1.)],[sp(430381.,0.523),sp(215.,0.046)]],Topology::Parallel,0.316).unwrap()),
    ("sp.5",Maxwell::new(sp(62740.,0.5),&[],Topology::Parallel,0.316).unwrap()),
    ("spring",Maxwell::new(sp(62740.,0.0),&[],Topology::Parallel,0.316).unwrap()),
    ("sls",Maxwell::new(sp(62740.,0.0),&[[sp(1e4,0.),sp(1e4,1.)],[sp(1e5,0.),sp(1e4,1.)]],Topology::Parallel,0.316).unwrap()),
    ("line",Maxwell::new(sp(100.,0.5),&[[sp(1e6,0.003),sp(1e5,0.998)],[sp(1e6,0.1),sp(3e4,0.9)]],Topology::Parallel,0.316).unwrap()),
    ("line9",Maxwell::new(sp(100.,0.5),&[[sp(1e6,3e-8),sp(1e5,1.-1e-8)],[sp(1e6,0.1),sp(3e4,0.9)]],Topology::Parallel,0.316).unwrap()),
    ("a1e-6",Maxwell::new(sp(1e5,1e-6),&[],Topology::Parallel,0.316).unwrap()),
    ("softmass",Maxwell::new(sp(100.,0.02),&[],Topology::Parallel,0.316).unwrap()),
  ];
  for i in 0..30{ let n=(rnd()*6.) as usize; let mut el=||sp(10f64.powf(2.+4.*rnd()),rnd()); let m=el(); let b:Vec<_>=(0..n).map(|_|[el(),el()]).collect();
    models.push(("rnd",Maxwell::new(m,&b,if i%2==0{Topology::Eq11}else{Topology::Parallel},0.316).unwrap())); }
  for rate in [100.,1000.,5000.]{ let h=1./rate; let n=(155.*rate) as usize+1;
    let k=8.8541878128e-12*4.7*0.04*0.06/(160e-6f64*160e-6);
    let f:Vec<f64>=(0..n).map(|i|{let v=3000.*(1.-(std::f64::consts::TAU*i as f64*h/7.).cos());k*v*v}).collect();
    let fm=FullMemory::with_oversampling(n,h,2);
    for (name,m) in &models{
      let t=std::time::Instant::now();
      let law=Law::<f64>::compressed(m,Options::at_step(h).with_tolerance(1.0));
      let law=match law{Ok(l)=>l,Err(e)=>{println!("{rate} {name} {e}");continue}};
      let law32=Law::<f32>::compressed(m,Options::at_step(h).with_tolerance(1.0)).unwrap();
      let tb=t.elapsed()/2;
      let full=fm.displacement(m,&f);
      let mut st=law.state(); let x:Vec<f64>=f.iter().map(|&f|law.displacement(&mut st,f)).collect();
      let t=std::time::Instant::now();
      let mut st=law32.state(); let x32:Vec<f64>=f.iter().map(|&f|law32.displacement(&mut st,f as f32) as f64).collect();
      let ts=t.elapsed().as_secs_f64()/n as f64*1e9;
      let mut st=law32.state(); let f32b:Vec<f64>=x32.iter().map(|&x|law32.force(&mut st,x as f32) as f64).collect();
      println!("{rate} {name} n={} tail {:.1e} f64 {:.1e} f32 {:.1e} round trip {:.1e} build {tb:?} step {ts:.0} ns",m.branches().len(),law.memory().tail_error(),rms(&x,&full),rms(&x32,&x),rms(&f32b,&f));
    }
  }
  println!("{} {}",size_of_val(&Law::<f32>::compressed(&models[0].1,Options::at_step(1e-3)).unwrap()),size_of_val(&Law::<f32>::compressed(&models[0].1,Options::at_step(1e-3)).unwrap().state()));
}
